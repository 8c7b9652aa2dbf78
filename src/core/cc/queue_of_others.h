// What queue the packets of a path meet, and how much of it is of others' making.
//
// A queue drains by a second in each second. So what a packet meets beyond what the one before it
// met, less the time between the two and what we sent meanwhile, has come from others: no rate of
// the pipe is needed for that where we were silent, and where we were not, ours counts twice, so
// that a pipe that has become half as fast convicts nobody. Radio delays packets without a queue.
// Most of such delays come at once, as no queue does, and are taken off.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"

namespace interneuron::cc {

// How many bytes had left by when, modulo 2^32, in slots of time, for a few hundred milliseconds.
// Constant memory, of which a roadside unit has much: so times are in microseconds modulo 2^32.
// Pure; thread-compatible; never throws.
class SentBytes {
 public:
  void sent(TimePoint now, std::size_t ip_bytes);
  // Bytes that had left by then; of the slot that it lies in none are counted.
  std::uint32_t by(TimePoint at) const;
  // The same, with all of that slot.
  std::uint32_t by_end_of_slot(TimePoint at) const;
  std::uint64_t all() const { return all_; }

 private:
  static constexpr std::size_t kSlots = 48;
  // What had left before the first packet of a slot.
  struct Slot {
    std::uint32_t start_us = 0;
    std::uint32_t before = 0;
  };
  std::array<Slot, kSlots> slots_{};
  std::size_t newest_ = 0;
  // How many slots are in use, and when the newest began.
  std::size_t used_ = 0;
  TimePoint newest_at_{};
  std::uint64_t all_ = 0;
};

// Owned and fed by the CrowdShare of a path. The delays are the peer's word: one that lies slows
// down what is sent to itself. Times are in seconds. Constant memory. Pure; thread-compatible;
// never throws.
class QueueOfOthers {
 public:
  void sent(TimePoint now, std::size_t ip_bytes) { sent_.sent(now, ip_bytes); }
  // A packet that left at `left_at` waited for so long in the queue of a pipe of this rate.
  void met(TimePoint now, TimePoint left_at, Duration waited, DataRate capacity);
  // Clocks stepped: what was met before cannot be compared.
  void clock_stepped();
  // Evidence counts from now on.
  void begin_again(TimePoint now);

  // What the newest packet met, and what packets met in the mean of a few round trips.
  double newest() const { return newest_; }
  double mean() const { return mean_; }
  // Others sent something lately, or may have: there is less evidence for it.
  bool are_there() const;
  bool may_be_there() const;
  // They are why packets wait, or may be why.
  bool are_in_the_way() const;
  bool may_be_in_the_way() const;
  // A packet waited for more than ours before it.
  bool others_were_met() const { return were_met_; }
  // There is a queue now, and packets of late waited for more than ours.
  bool others_are_suspected() const;
  // They have been seen since begin_again(), too.
  bool were_confirmed() const;

 private:
  void suspect(TimePoint left_at, double met, DataRate capacity);
  bool exceeds(double queue, double least) const;
  void judge(TimePoint left_at, double met, DataRate capacity);

  SentBytes sent_;
  // The newest packet: what it met, when it left and when that was told; and what of its delay is
  // no queue.
  double newest_ = 0;
  std::optional<TimePoint> left_at_;
  TimePoint met_at_{};
  double held_up_ = 0;
  double mean_ = 0;
  // What others added between two packets, in the mean.
  double others_ = 0;
  // What packets waited for beyond ours, in the mean, and whether one ever did.
  double suspected_ = 0;
  bool were_met_ = false;
  // The time of a few packets, which nobody's queue is shorter than.
  double grain_ = 0;
  // Packets in a row, with nothing of ours before them, for which others were in the queue.
  int in_a_row_ = 0;
  TimePoint since_ = TimePoint::min();
  int confirmed_ = 0;
};

}  // namespace interneuron::cc
