// Which messages were certainly not complete at the peer by their deadline, as its acknowledgements
// tell.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "core/base/flat_map.h"
#include "core/flow/sent_packets.h"
#include "core/wire/feedback.h"
#include "interneuron/few.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Sender owns one, and gives it each plain message whose deadline has passed before all of it was
// acknowledged, with one piece that was not. Where no copy of that piece ever left, the message was
// incomplete. Else it was where every path that carried a copy reports, of an instant after the
// deadline, that none has arrived: the receiver of a packet tells of it in each report until
// wire::kAckWindow later ones have come. What is not certain is never told: a report that tells no
// more of a copy, however many packets have overtaken it, a path that was removed, or one that the
// peer has forgotten meanwhile, which shows in counting its bytes anew. A peer that has a part of
// the message tells by itself that it never became complete (Receipts).
//
// The peer may lie, and harms only what is sent to itself. Memory: kMost messages at most, for
// kKept, and what was told last of each path. Pure; thread-compatible.
class Overdue {
 public:
  // Copies of the piece: the path, and the smallest number of their packets there.
  struct Copies {
    LinkId path{};
    std::uint64_t first = 0;
  };
  using Paths = Few<Copies, wire::kMaxReports>;

  void add(TimePoint now, const SentPackets::Piece& missing, TimePoint deadline,
           const Paths& copies);
  // A piece has arrived after all.
  void arrived(const SentPackets::Piece& piece);
  // The peer's report of a path that there is, which it sent at `left` or later; nothing: not known
  // when.
  void report(const wire::LinkReport& report, std::optional<TimePoint> left);
  void remove_path(LinkId path);
  // Messages that were not complete, each once.
  std::optional<MessageId> poll() {
    if (incomplete_.empty()) return std::nullopt;
    const MessageId message = incomplete_.front();
    incomplete_.pop_front();
    return message;
  }
  bool has_any() const { return !incomplete_.empty(); }
  void clear();

 private:
  // No measurement behind these values: they only have to be more than what is overdue within a
  // round trip, and longer than a fate is waited for over most paths.
  static constexpr std::size_t kMost = 1024;
  static constexpr Duration kKept = std::chrono::seconds(3);

  struct Entry {
    std::uint16_t missing = 0;
    TimePoint deadline{};
    // The copies on paths that have not told yet.
    Paths copies;
  };
  struct Told {
    std::uint64_t largest = 0;
    std::uint64_t bytes = 0;
    // The peer remembers nothing of packets before this one.
    std::uint64_t from = 0;
  };
  enum class Answer : std::uint8_t { kWaits, kNotThere, kUnsure };
  static Answer answer(const Copies& copies, const Told& told, bool is_after);

  std::map<MessageId, Entry> entries_;
  FlatMap<LinkId, Told> told_;
  std::deque<MessageId> incomplete_;
};

}  // namespace interneuron::flow
