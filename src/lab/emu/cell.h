// One direction of a bottleneck that several links and cross traffic share, as the vehicles of one
// radio cell do: a queue, first in, first out, in front of one Bottleneck. Unlike a LinkModel it
// adds no delay of its own and loses nothing by chance; it may manage its queue (CoDel, RFC 8289)
// and mark packets instead of dropping them (ECN). It keeps handles of packets (tags), never bytes.
//
//   enqueue -> MTU -> [ queue with a limit of bytes ] -> CoDel, step of marks -> [ bottleneck ] ->
//   dequeue
//
// CoDel and the step look at a packet when its transmission begins; with opportunities, which have
// no duration, at the opportunity. ECN: CoDel marks a packet whose sender understands marks (ECT)
// and drops others; the step marks those of L4S, which ask for it with ECT(1) (RFC 9331); a full
// queue drops any.
//
// A packet costs about 100 ns and no allocation in the steady state. Bounds: queue_bytes, and one
// FlowStats for each number below the largest flow. Pure; thread-compatible; no errors; times are
// since the start of the cell.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/ring.h"
#include "interneuron/units.h"
#include "lab/emu/bottleneck.h"
#include "lab/emu/queue.h"

namespace interneuron::emu {

struct CellParams {
  // The rate of the bottleneck; with 0 or less nothing passes.
  DataRate rate{};
  // A rate that changes with time, in place of `rate`.
  std::optional<RateTrace> trace{};
  // The most bytes that may wait, with the whole of the packet that is leaving; see
  // queue_bytes_of(). An idle bottleneck takes any packet.
  std::size_t queue_bytes = 0;
  // Larger packets vanish without an error (a path MTU black hole); 0: there is no limit.
  std::size_t mtu = 0;
  // The queue is managed; empty: packets are dropped at its tail only.
  std::optional<CoDelParams> codel{};
  // ECT(1) packets that have waited longer are marked; empty: there is no step of marks.
  std::optional<Duration> mark_above{};
};

// The bytes that take `time` at `rate`: how deep a queue is that holds packets for so long.
constexpr std::size_t queue_bytes_of(DataRate rate, Duration time) {
  const double seconds = static_cast<double>(time.count()) / 1e9;
  return static_cast<std::size_t>(static_cast<double>(rate.bits_per_second) / 8 * seconds);
}

// Counters since the start, of a cell or of one flow; bytes are IP bytes. Always
//   packets_in = delivered + queue_drops + codel_drops + too_big + packets inside
struct CellStats {
  std::uint64_t packets_in = 0;
  std::uint64_t bytes_in = 0;
  std::uint64_t delivered = 0;
  std::uint64_t bytes_delivered = 0;
  // Dropped at the tail of the queue, which was full.
  std::uint64_t queue_drops = 0;
  std::uint64_t codel_drops = 0;
  // How many of those delivered had a mark; also those that came with one.
  std::uint64_t marked = 0;
  // Larger than the MTU.
  std::uint64_t too_big = 0;
};

class Cell {
 public:
  explicit Cell(const CellParams& params);

  struct Packet {
    // The caller's handle of the packet.
    std::uint64_t tag = 0;
    // Whose packet it is: a small number that the caller chooses, by which packets are counted.
    std::uint32_t flow = 0;
    std::size_t ip_bytes = 0;
    Ecn ecn = Ecn::kNotEct;
  };
  struct Departed {
    // With the mark, if it got one.
    Packet packet;
    // When it left, or was dropped.
    Duration at{};
    // CoDel has dropped it: the caller only frees it.
    bool dropped = false;
  };

  // A packet enters at `now`, which never goes back. Returns false when it was dropped (and
  // counted), and the caller may forget it; else it comes out of dequeue().
  bool enqueue(Duration now, const Packet& packet);
  // When the next packet leaves; nothing: not before another one enters.
  std::optional<Duration> next_departure() const;
  // The next packet that has left by `now`, if any, in the order of entry.
  std::optional<Departed> dequeue(Duration now);

  // Forgets queue_time() and begins utilisation() anew: what comes before `now` was a warm-up.
  void measure_from(Duration now);
  // The time-weighted wait since measure_from(), as far as it is known: what is to be told of the
  // packets inside is missing.
  const QueueTime& queue_time() const { return queue_time_; }
  // The share of what the bottleneck could carry since measure_from() that it has delivered, over
  // [0, 1]; 0 while it could carry nothing.
  double utilisation(Duration now) const;

  const CellParams& params() const { return params_; }
  const CellStats& stats() const { return stats_; }
  // The counters of one flow; all 0 for one that has sent nothing.
  const CellStats& stats(std::uint32_t flow) const;
  // The bytes that wait, with the whole of the packet that is leaving.
  std::size_t waiting_bytes() const { return waiting_bytes_; }

 private:
  struct Waiting {
    Packet packet;
    Duration arrived{};
  };

  template <class Change>
  void count(std::uint32_t flow, const Change& change);
  void serve_next(Duration at);
  bool passes(Waiting& waiting, Duration at);
  void advance(Duration now);
  void leave(Duration at, bool dropped);

  CellParams params_;
  Bottleneck bottleneck_;
  CoDel codel_;
  // CoDel and the step look at packets when they leave, see above.
  bool judged_at_departure_;
  Ring<Waiting> queue_;
  std::size_t waiting_bytes_ = 0;
  // When the packet at the head has left the bottleneck.
  Duration departure_ = Duration::max();
  // When the newest packet left: since then the queue is empty, unless one waits.
  Duration emptied_{};
  // What has left and was not handed out.
  Ring<Departed> out_;
  QueueTime queue_time_;
  Duration measured_from_{};
  std::uint64_t bytes_before_ = 0;
  CellStats stats_;
  std::vector<CellStats> flows_;
};

}  // namespace interneuron::emu
