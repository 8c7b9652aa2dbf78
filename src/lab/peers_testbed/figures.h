// What a run comes to: a row of figures for each deadline by which it is judged.
//
// Pure; thread-safe; no errors: arrivals of messages that were never handed over are left out.
#pragma once

#include <optional>
#include <vector>

#include "lab/peers_testbed/scenario.h"

namespace interneuron::peers {

struct Row {
  const Scenario* scenario = nullptr;
  const Peer* peer = nullptr;
  std::size_t message_bytes = 0;
  Duration period{};
  Duration deadline{};
  std::uint64_t seed = 0;
  std::size_t messages = 0;
  // Without any variant by the deadline.
  std::size_t missed = 0;
  // On time, but in a smaller variant.
  std::size_t degraded = 0;
  // IP bytes that left the vehicle by its modems, over the bytes of the whole messages.
  double wire_ratio = 0;
  // From handing over to arrival, of all messages: the age that half of them, 99 % of them had at
  // most. Nothing: as many never came. A peer may not deliver what is late.
  std::optional<double> p50_ms{};
  std::optional<double> p99_ms{};
  // Processor time of the sending program and of the receiving one, for each message.
  double cpu_us_send = 0;
  // Nothing: fewer than two messages came.
  std::optional<double> cpu_us_receive{};
  // Which messages those without any variant were, counted from 0, in order.
  std::vector<std::size_t> missed_numbers{};
  // By how much the emulator was late with a packet at most: a message may be missed for that.
  double emulator_late_ms = 0;
};

// One row for each deadline of the run.
std::vector<Row> rows_of(const Run& run, const cli::VehiclesRecord& vehicle,
                         const cli::RoadRecord& road);

}  // namespace interneuron::peers
