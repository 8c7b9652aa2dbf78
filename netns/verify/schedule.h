// What a link's schedule prescribes for packets sent at given times: the model's own words, read
// back after the fact, against which independent tools are held.
//
// Times are since the epoch of the testbed's links. Pure; thread-compatible.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "lab/emu/conditions.h"
#include "netns/state/snapshot.h"

namespace interneuron::cli::verify {

using emu::Direction;

class Schedule {
 public:
  Schedule() = default;
  // One sample per emu::kDelayStep, rising.
  explicit Schedule(std::vector<netns::ScheduleSample> samples) : samples_(std::move(samples)) {}

  bool empty() const { return samples_.empty(); }
  // Both instants lie within the samples.
  bool covers(Duration from, Duration to) const;

  // Of the samples; not to be called when empty.
  Duration begin() const { return samples_.front().at; }
  Duration end() const { return samples_.back().at + emu::kDelayStep; }
  // Before the first and after the last sample, these hold. Not to be called when empty.
  Duration one_way(Duration t) const { return at(t).rtt / 2; }
  double loss(Direction direction, Duration t) const;
  DataRate rate(Direction direction, Duration t) const;
  DataRate top_rate(Direction direction) const;

  // More than half of [from, to) without radio.
  bool mostly_out(Direction direction, Duration from, Duration to) const;
  // Bits that a bottleneck that is never idle sends in [from, to), less those that the radio loses.
  double bits_between(Direction direction, Duration from, Duration to) const;
  // When what arrives at `arrival` left the bottleneck at the latest.
  Duration sent_by(Duration arrival) const;

 private:
  const netns::ScheduleSample& at(Duration t) const;

  std::vector<netns::ScheduleSample> samples_;
};

// A packet that entered one direction of a link.
struct Sent {
  Duration at{};
  std::size_t ip_bytes = 0;
  bool lost = false;
};

// When packets of one direction should arrive: each waits for those before it at the bottleneck,
// takes half the scheduled round trip of the instant at which it has left that, and never
// overtakes.
class Course {
 public:
  // `traffic` in order of time; all that used the link in this direction, or nearly.
  Course(const Schedule& schedule, Direction direction, std::span<const Sent> traffic);

  // Of traffic[i].
  Duration arrival(std::size_t i) const { return after_[i].due; }
  // Of a packet beside the traffic.
  Duration arrival(Duration at, std::size_t ip_bytes) const;

 private:
  struct Moment {      // after a packet
    Duration at{};     // when that entered
    Duration idle{};   // when the bottleneck has sent it
    Duration due{};    // when it arrives
    Duration floor{};  // nothing arrives before
  };
  Moment follow(const Moment& before, const Sent& packet) const;

  const Schedule& schedule_;
  Direction direction_;
  std::vector<Moment> after_;
};

}  // namespace interneuron::cli::verify
