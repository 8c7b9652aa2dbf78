// Two paths of a Sender, and the reports of a peer, for its tests.
#pragma once

#include <set>
#include <vector>

#include "core/flow/sender.h"

namespace interneuron::flow {

using namespace std::chrono_literals;

inline constexpr LinkId kA{0};
inline constexpr LinkId kB{1};
inline constexpr std::size_t kDatagram = 1400;
inline constexpr std::size_t kChunk = kDatagram - kPieceOverheadBytes;
inline constexpr TimePoint kFar{1h};

inline TimePoint at(Duration d) { return TimePoint{d}; }

inline PathView view(Duration one_way, double mbit = 100, bool up = true) {
  PathView v;
  v.up = up;
  v.rate = DataRate::mbit(mbit);
  v.pace = DataRate::mbit(mbit * 1.25);
  v.one_way = one_way;
  v.probe_timeout = 50ms;
  return v;
}

// Paths at 100 Mbit/s, 10 ms one way.
struct Paths {
  Sender sender;
  explicit Paths(bool repair = true) : sender({.repair = repair}) {
    for (const LinkId link : {kA, kB}) {
      sender.add_path(link, kDatagram);
      set(link, 10ms);
    }
  }
  void set(LinkId link, Duration one_way, double mbit = 100, bool up = true) {
    sender.set_path(link, view(one_way, mbit, up));
  }
  MessageId send(TimePoint now, TimePoint deadline, std::size_t pieces, const PathList& on) {
    return sender.send(now, {.deadline = deadline, .lifetime = deadline - now},
                       Bytes(pieces * kChunk), on);
  }
  // Nothing more may leave, now or later.
  bool idle(TimePoint now) {
    const bool sent = sender.poll(now, kA) || sender.poll(now, kB);
    return !sent && !sender.next_send(kA) && !sender.next_send(kB);
  }
  // Everything that leaves a path, in time.
  std::vector<Sender::Piece> drain(LinkId link, TimePoint& now, Duration step = 100us,
                                   int turns = 100'000) {
    std::vector<Sender::Piece> out;
    for (int i = 0; i < turns && sender.next_send(link); ++i, now += step) {
      while (const auto piece = sender.poll(now, link)) out.push_back(*piece);
    }
    return out;
  }
};

inline wire::LinkReport report_of(LinkId link, const std::set<std::uint64_t>& arrived) {
  wire::LinkReport r{.link = link};
  if (arrived.empty()) return r;
  r.largest = *arrived.rbegin();
  for (const std::uint64_t n : arrived) {
    const std::uint64_t back = r.largest - n;
    if (back > 0 && back <= wire::kAckWindow)
      r.bitmap[(back - 1) / 64] |= 1ULL << ((back - 1) % 64);
  }
  return r;
}

}  // namespace interneuron::flow
