// The share of a bottleneck that others use as well: a rate that is kept in the mean, however the
// traffic comes in bursts.
//
// A camera sends a frame every 100 ms and nothing in between. Held to its fair share a frame of a
// crowded cell would take longer than its deadline, and sent at once fifty of them would stand in
// the queue. So the share is a token bucket: what was not used of it is saved up, and a message for
// which enough is saved leaves within a third of its time. A message that finds too little gives
// way to a smaller variant or is refused, which saves for the next one. That every sender takes its
// turn by its own savings needs no agreement and no fine balance: all of them at one threshold
// would go up and down together.
//
// The rate follows the mean queue of the last few round trips, of which all senders see the same
// one (Chiu and Jain, Analysis of the Increase and Decrease Algorithms for Congestion Avoidance in
// Computer Networks, 1989: proportional falls and equal steps up make shares equal). A queue of our
// own making is no crowd: it is followed by what has left here and what the pipe carries.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"

namespace interneuron::cc {

// How many bytes had left by when, in slots of time. Constant memory. Pure; thread-compatible; never
// throws.
class SentBytes {
 public:
  void sent(TimePoint now, std::size_t ip_bytes);
  // Bytes that left before the slot of this time.
  std::uint64_t before(TimePoint at) const;
  std::uint64_t all() const { return all_; }

 private:
  static constexpr std::size_t kSlots = 128;
  // What had left before the first packet of a slot.
  struct Slot {
    TimePoint start = TimePoint::min();
    std::uint64_t before = 0;
  };
  std::array<Slot, kSlots> slots_{};
  std::size_t newest_ = 0;
  std::uint64_t all_ = 0;
};

// Owned and fed by the ShareControl of the path. What it is told of the queue is the peer's word:
// one that lies slows down what is sent to itself. Constant memory. Pure; thread-compatible; never
// throws.
class CrowdShare {
 public:
  // What trains show of the pipe. Among those of others they show less, which is no news.
  void set_capacity(DataRate capacity) {
    capacity_ = is_shared() && !is_new_ ? std::max(capacity_, capacity) : capacity;
  }
  DataRate capacity() const { return capacity_; }
  // Bytes with IP headers left.
  void sent(TimePoint now, std::size_t ip_bytes);
  // The newest message has so many bytes in its best and in its smallest variant, and so long to
  // leave and to wait in queues.
  void asked(TimePoint now, std::size_t best, std::size_t smallest, Duration left);
  // A packet that left at `left_at` met this queue.
  void met(TimePoint now, TimePoint left_at, Duration queue);
  // A train arrived more slowly than it left and than the pipe carries.
  void stretched(TimePoint now) { stretched_at_ = now; }
  // Packets were lost.
  void lost(std::uint32_t packets) { lost_ += packets; }
  // Clocks stepped: what was met cannot be compared.
  void clock_stepped();
  // Adapts the rate where that is due.
  void decide(TimePoint now, Duration round_trip);

  // Others are there, or it is not known yet that they are not: the rest of this class counts.
  bool is_shared() const { return rate_.has_value(); }
  // The share in the mean.
  DataRate rate() const { return *rate_; }
  // The rate at which the newest message would be sent: what is needed where enough is saved up for
  // it, else the share.
  DataRate planned() const;
  // What is waited for in the mean.
  Duration queue() const;

 private:
  double saved(TimePoint now) const;
  void enter(TimePoint now);
  void adapt(TimePoint now);
  double target() const;
  void dice();

  DataRate capacity_{};
  SentBytes sent_;
  std::optional<DataRate> rate_;
  // It began low and doubles, as nothing was met yet.
  bool is_new_ = true;
  double asked_ = 0;
  // What brings its best and its smallest variant in time.
  DataRate best_{};
  DataRate smallest_{};
  // Enough was saved up for the newest message.
  bool granted_ = false;
  // Bytes that are saved up, and at when.
  double saved_ = 0;
  TimePoint saved_at_{};
  // What is sent in the mean, in bytes per second.
  double used_ = 0;
  TimePoint used_at_{};
  // The newest queue, when its packet left, and the mean one, in seconds.
  double newest_ = 0;
  TimePoint left_at_{};
  double mean_ = 0;
  double others_ = 0;
  TimePoint met_at_{};
  bool has_met_ = false;
  std::optional<TimePoint> stretched_at_;
  std::uint32_t lost_ = 0;
  // The longest queue since the last decision, and that of the period before.
  TimePoint decide_at_ = TimePoint::min();
  // When others were last seen, and when the queue was last above half of the target.
  std::optional<TimePoint> others_at_;
  TimePoint queued_at_{};
  // The longest queue since the last decision, and that of the period before.
  double longest_ = 0;
  double before_ = 0;
  TimePoint fall_at_{};
  double threshold_ = 1;
  DataRate floor_{};
  double held_up_ = 0;
  int strong_ = 0;
  TimePoint asked_at_{};
  double period_ = 0;
  double spare_[10] = {};
};

}  // namespace interneuron::cc
