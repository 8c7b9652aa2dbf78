// What the model of a link prescribed while it was measured, and when packets should have arrived
// under it. The testbed records the model's values every 10 ms; they are read back after the
// measurement and compared with what independent tools saw.
//
// Times are since the epoch of the testbed's links. Pure; thread-compatible; no errors.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "lab/emu/conditions.h"
#include "netns/state/snapshot.h"

namespace interneuron::netns::verify {

using emu::Direction;

// Round trip, loss and rate of one link over a span of time, as samples of emu::kDelayStep each.
// A value; filled by Testbed::schedule(). Only empty() and covers() may be called when it is empty.
class Schedule {
 public:
  Schedule() = default;
  // `samples` are consecutive steps of emu::kDelayStep.
  explicit Schedule(std::vector<ScheduleSample> samples) : samples_(std::move(samples)) {}

  bool empty() const { return samples_.empty(); }
  // Whether both instants lie within the samples.
  bool covers(Duration from, Duration to) const;

  // The span of the samples.
  Duration begin() const { return samples_.front().at; }
  Duration end() const { return samples_.back().at + emu::kDelayStep; }
  // The values at `t`; outside the span, those of its first or last sample. Loss is from 0 to 1.
  Duration one_way(Duration t) const { return at(t).rtt / 2; }
  double loss(Direction direction, Duration t) const;
  DataRate rate(Direction direction, Duration t) const;
  // The highest rate in the samples.
  DataRate top_rate(Direction direction) const;

  // Whether everything is lost (an outage) during more than half of [from, to).
  bool mostly_out(Direction direction, Duration from, Duration to) const;
  // The bits that a bottleneck which is never idle delivers in [from, to): those sent less those
  // lost on the radio.
  double bits_between(Direction direction, Duration from, Duration to) const;
  // The latest time at which a packet that arrives at `arrival` can have left the bottleneck.
  Duration sent_by(Duration arrival) const;

 private:
  const ScheduleSample& at(Duration t) const;

  std::vector<ScheduleSample> samples_;
};

// A packet that entered one direction of a link.
struct Sent {
  Duration at{};
  std::size_t ip_bytes = 0;
  bool lost = false;
};

// When the packets of one direction should arrive under a schedule: a packet waits at the
// bottleneck until those before it have been sent, then takes half the scheduled round trip of the
// instant at which it leaves the bottleneck, and never overtakes one before it. Refers to the
// schedule, which must outlive it and must not be empty. Memory: one entry per packet.
class Course {
 public:
  // `traffic`: the packets that used the link in this direction, in order of time. Packets that
  // are missing from it make no queue, so arrivals behind them are predicted too early.
  Course(const Schedule& schedule, Direction direction, std::span<const Sent> traffic);

  // The arrival time of traffic[i], also where that was lost.
  Duration arrival(std::size_t i) const { return after_[i].due; }
  // The arrival time of a packet that is not part of the traffic, sent at `at`.
  Duration arrival(Duration at, std::size_t ip_bytes) const;

 private:
  // The state of the link after a packet.
  struct Moment {
    // When the packet was sent.
    Duration at{};
    // When the bottleneck has sent it and is idle.
    Duration idle{};
    // When it arrives.
    Duration due{};
    // No later packet arrives before this: the latest arrival of a packet that was not lost.
    Duration floor{};
  };
  Moment follow(const Moment& before, const Sent& packet) const;

  const Schedule& schedule_;
  Direction direction_;
  std::vector<Moment> after_;
};

}  // namespace interneuron::netns::verify
