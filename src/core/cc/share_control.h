// Congestion control of one path: which share of its bottleneck this sender may use, how fast
// packets leave, and how many bytes may be in flight.
//
// The traffic is that of frames: a burst every 100 ms and nothing in between, so the application
// and not the network limits it most of the time. What is known of the pipe is its capacity, from
// the dispersion of trains (link::RateEstimator); what others leave of it is learnt here, once per
// round trip, from four signs:
//
//   queue      the least one-way delay of the last round trip's packets above the least of the last
//              10 s. Radio adds delay that no sender can drain, so delay alone convicts nobody.
//   stretch    trains arrive more slowly than they left and than the pipe carries: others' packets
//              lie between ours, if any were met lately; else the radio fades.
//   marks      of ECN, wherever packets come with them: a queue says of itself that it is one.
//   duty       the share of time in which something waited here. At a duty of one we are
//              overloaded, and the queue is ours to drain.
//
// The rate falls in proportion to how far the queue is above the target where the stretch or the
// duty says that it is a queue, by a fixed factor for losses with a queue, and for marks by a fixed
// factor where the queue is a long one and in proportion to how many packets are marked where it is
// a short one of L4S; never below what arrived, unless we are overloaded. It rises by one packet
// per round trip, which is the same for everyone and so makes shares equal (Chiu and Jain, Analysis
// of the Increase and Decrease Algorithms for Congestion Avoidance in Computer Networks, 1989), and
// faster where no queue was seen for several round trips; to the capacity where nobody else is. The
// target bears a CUBIC flow on a buffer of 30 ms beside it.
//
// Where others make a queue longer than the target, CrowdShare sets the rate until they are gone;
// meanwhile marks and losses are answered only where these give way to nobody.
#pragma once

#include <cstdint>
#include <optional>

#include "core/cc/aggregation.h"
#include "core/cc/crowd_share.h"
#include "core/link/windowed_minimum.h"
#include "interneuron/units.h"

namespace interneuron::cc {

// Owned and fed by the Path whose reports it is told of (src/core/peers). All of a report is the
// peer's word: one that lies slows down what is sent to itself, or makes us fill its own link as
// fast as the estimated capacity, which is what happened without congestion control. Constant
// memory. Pure; thread-compatible; never throws.
class ShareControl {
 public:
  explicit ShareControl(std::uint64_t seed = 0) : crowd_(seed) {}
  // The queue that is aimed at: a fifth of a deadline of 150 ms, and as long as the shortest buffer
  // on which shares with a CUBIC flow are to be fair.
  static constexpr Duration kTarget = std::chrono::milliseconds(30);

  // A train as the receiver measured it.
  struct Train {
    std::uint32_t packets = 0;
    DataRate arrived_at{};
    // Nothing: it left back to back, faster than any link.
    std::optional<DataRate> sent_at;
    // How much later than the least round trip of small packets it was told of.
    Duration waited{};
  };
  // What one report of the peer tells, and how the path was used since the last one.
  struct Report {
    // From when the newest packet that it acknowledges left until now.
    std::optional<Duration> round_trip;
    // The newest data-sized packet's one-way delay with the clocks' offset, modulo 2^32.
    std::optional<std::uint32_t> one_way_us;
    // Data-sized packets newly found lost, and bytes with IP headers newly known to have arrived.
    std::uint32_t lost = 0;
    std::size_t arrived = 0;
    // Packets that came with ECT or a mark of ECN, and the marked ones of these.
    std::uint32_t ect = 0;
    std::uint32_t marked = 0;
    std::optional<Train> train;
    // The rate of the pipe; nothing while it is not known.
    std::optional<DataRate> capacity;
    // Something had to wait for the pace or the window.
    bool held_back = false;
    // For how long something was queued.
    Duration backlog{};
    // The rate at which the newest message is sent within a third of its time.
    DataRate needed{};
  };
  void report(TimePoint now, const Report& report);
  // Bytes with IP headers left.
  void sent(TimePoint now, std::size_t ip_bytes) { crowd_.sent(now, ip_bytes); }
  // A message is to be sent, or refused, whose best and smallest variants have so many bytes;
  // `least_round_trip`: that of small packets, zero while it is not known.
  void asked(TimePoint now, std::size_t best, std::size_t smallest, Duration deadline,
             Duration least_round_trip = {});
  // A small packet that left then took so long, with the clocks' offset in it: the peer's word.
  void exchange(TimePoint now, TimePoint left_at, Duration one_way);
  // A clock stepped: old and new delays cannot be compared. What no queue could make is noticed.
  void clock_stepped();
  // The marks that were told of were no queue's: what they took is given back.
  void marks_were_false();

  // What may be planned with; nothing while the capacity is not known.
  std::optional<DataRate> rate() const { return rate_; }
  // The rate at which the newest message would be sent; nothing while the capacity is not known.
  std::optional<DataRate> planned() const;
  // What the path may carry soon: the whole pipe where nothing is in the way now and the rate is
  // about to rise; nothing while the capacity is not known.
  std::optional<DataRate> soon(TimePoint now) const;
  // How fast packets leave; nothing while it is for the search of the capacity to say.
  std::optional<DataRate> pace() const;
  // Others use the path as well.
  bool is_crowded() const { return crowd_.is_crowded(); }
  // What the pipe is known to carry where others are, zero where nobody is.
  DataRate known_capacity() const { return crowd_.is_crowded() ? crowd_.capacity() : DataRate{}; }
  // How long a packet takes at least, with the queue that others have made.
  Duration least_one_way(Duration least_round_trip) const;
  // Bytes with IP headers that may be in flight.
  std::size_t window() const;
  // We are overloaded, or gave way within the last second: what else is in flight waits in a queue.
  bool loaded(TimePoint now) const { return crowd_.is_crowded() || overloaded() || gave_way(now); }
  // A queue has marked packets within the last second.
  bool marked(TimePoint now) const;

 private:
  // What was seen since the last decision.
  struct Seen {
    Duration queue = Duration::max();
    std::uint32_t lost = 0;
    std::uint32_t ect = 0;
    std::uint32_t marked = 0;
    // How many of the marked packets left after the rate last fell for marks.
    std::uint32_t newly_marked = 0;
    bool held_back = false;
    bool stretched = false;
    // A train was long enough for packets of others to lie within it.
    bool long_train = false;
    DataRate arrived_at{};
  };
  std::optional<std::int64_t> least_of(TimePoint now, link::WindowedMinimum& delays);
  void note_round_trip(TimePoint now, Duration round_trip);
  void note_one_way(TimePoint now, std::uint32_t one_way_us);
  void note_duty(TimePoint now, Duration backlog);
  void note_capacity(TimePoint now, DataRate capacity);
  void note_train(TimePoint now, const Train& train);
  bool share(TimePoint now);
  void decide(TimePoint now);
  void adapt_target();
  void note_marks();
  Duration burst() const;
  DataRate floor() const;
  void answer_marks(TimePoint now);
  void forget_unused(TimePoint now);
  void fall(TimePoint now, double factor, DataRate floor);
  void rise(TimePoint now);
  DataRate most() const;
  bool overloaded() const;
  bool gave_way(TimePoint now) const;

  CrowdShare crowd_;
  link::WindowedMinimum least_exchange_;
  TimePoint exchanged_at_ = TimePoint::min();
  std::optional<DataRate> rate_;
  DataRate capacity_{};
  link::WindowedMinimum least_round_trip_;
  Duration base_{};
  // One-way delays in microseconds since the first one, so that they do not wrap, the newest as it
  // came, and when its packet left.
  link::WindowedMinimum least_one_way_;
  std::int64_t one_way_ = 0;
  std::optional<std::uint32_t> one_way_us_;
  TimePoint one_way_sent_at_{};
  Duration round_trip_{};
  Duration queue_{};
  Aggregation aggregation_;
  double duty_ = 0;
  // Trains of late were long ones.
  bool long_trains_ = true;
  DataRate needed_{};
  std::optional<TimePoint> reported_at_;
  Seen seen_;
  // When something was last acknowledged, and when the next decision is due.
  TimePoint used_at_{};
  TimePoint decide_at_ = TimePoint::min();
  std::optional<TimePoint> fell_at_;
  std::optional<TimePoint> marked_at_;
  // When the rate last fell for marks.
  TimePoint answered_marks_at_ = TimePoint::min();
  // Packets were lost within the last second: a search for more capacity would lose more.
  std::optional<TimePoint> lost_at_;
  bool lost_lately_ = false;
  // The smoothed share of packets that are marked: alpha of DCTCP (RFC 8257).
  double marked_ = 1;
  // Decisions in a row that let the rate rise.
  int calm_ = 0;
  // The queue aimed at now, less than kTarget where a shorter one loses packets, and pace / rate.
  Duration target_ = kTarget;
  double gain_ = 0;
  // When the round trip was last near its minimum, nothing had been sent for a while, or the window
  // was last held low to see it; whether it is held low, and until when.
  TimePoint near_base_at_{};
  bool draining_ = false;
  TimePoint drain_until_ = TimePoint::min();
};

}  // namespace interneuron::cc
