// What a run under load comes to: a row of figures. Those that follow from the fates of the
// messages are the same in virtual time and on real sockets.
//
// Pure; thread-safe; no errors.
#pragma once

#include <cstddef>
#include <optional>

#include "lab/load/meter.h"
#include "lab/load/scenario.h"

namespace interneuron::load {

struct Row {
  Scenario scenario;
  std::size_t messages = 0;
  // Without any variant by the deadline.
  std::size_t missed = 0;
  // On time in the smaller variant.
  std::size_t degraded = 0;
  // How old messages were that arrived on time, and the rate at which their payload came.
  double age_p50_ms = 0;
  double age_p99_ms = 0;
  double on_time_goodput_mbit = 0;
  // On-time payload over the lesser of what was offered and what the bottleneck could have carried.
  double of_possible = 0;
  // At the bottleneck, weighted by time, from the first message on until the last one ends; where
  // there is a time of joining (joining_time()), after that, and in it.
  double queue_p99_ms = 0;
  std::optional<double> joining_queue_p99_ms{};
  // The share of the bottleneck's capacity, dips included, that was used.
  double utilisation = 0;
  // How evenly the vehicles share what arrives on time; nothing for one vehicle alone.
  std::optional<double> jain{};
  // Of the messages that a vehicle begins within kEarly of its first one, and of the others, how
  // many percent missed; nothing for one vehicle alone.
  std::optional<double> early_missed_percent{};
  std::optional<double> later_missed_percent{};
  // After a dip, from the return of the rate until the first whole message that is on time is
  // handed over; nothing when there is none.
  std::optional<double> whole_after_ms{};
  // For a late vehicle, from its first message until it has had 80 % of its fair share for half a
  // second; nothing when that never was.
  std::optional<double> share_after_ms{};
  // Beside cross traffic: the on-time payload, and what the applications of the cross traffic could
  // read, each over its fair share of what the bottleneck could have carried.
  std::optional<double> own_share{};
  std::optional<double> cross_share{};
  // On the testbed: the processor time of the receiving program over the time that went by, from
  // the first message to the last one; 100 is all of one processor.
  std::optional<double> road_cpu_percent{};
};

// The bottleneck over a part of a run.
struct BottleneckPart {
  Duration length{};
  double queue_p99_ms = 0;
  double utilisation = 0;
};

// What the bottleneck could have carried while messages began, dips included: bytes, and the
// payload of messages like these, without what nobody was there for while vehicles joined.
double capacity_bytes(const Scenario& scenario);
double payload_capacity(const Scenario& scenario);

// Fills in what follows from the messages; `begin` is when the first of them might begin.
void read_messages(const Scenario& scenario, const Meter& meter, Duration begin, Row& row);
// The same of the bottleneck: of the time of joining, where there is one, and of the rest.
void read_bottleneck(const std::optional<BottleneckPart>& joining, const BottleneckPart& rest,
                     Row& row);
// The same of cross traffic, whose applications could read so many bytes meanwhile.
void read_cross_traffic(const Scenario& scenario, const Meter& meter, double bytes, Row& row);

}  // namespace interneuron::load
