// Values read from a running testbed by Testbed::snapshot() and Testbed::schedule(): counters of
// its links, and what their models prescribed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "interneuron/units.h"
#include "lab/emu/link_model.h"

namespace interneuron::netns {

struct LinkSnapshot {
  std::string name;
  std::size_t vehicle = 0;
  // Up is from the vehicle to the roadside. Bytes are IP bytes.
  emu::DirectionStats up;
  emu::DirectionStats down;
};

// One direction of a cell. The counters are since the start; the other figures are since
// Testbed::measure_cells(), if that was called, and at most 0.1 s old.
struct CellDirection {
  std::uint64_t packets_in = 0;
  // IP bytes.
  std::uint64_t bytes_delivered = 0;
  // At the tail of the queue, by CoDel, or larger than the MTU.
  std::uint64_t dropped = 0;
  std::uint64_t marked = 0;
  // How long a packet would have had to wait, weighted by time (emu::QueueTime).
  Duration queue_p99{};
  Duration queue_mean{};
  // The share of what the bottleneck could carry that it has delivered.
  double utilisation = 0;
};

struct CellSnapshot {
  CellDirection up;
  CellDirection down;
};

// What the model prescribed for one link at one of its steps (emu::kDelayStep).
struct ScheduleSample {
  // Since the epoch.
  Duration at{};
  // The round-trip time without queueing.
  Duration rtt{};
  // From 0 to 1.
  double loss_up = 0;
  double loss_down = 0;
  DataRate rate_up{};
  DataRate rate_down{};
};

// The counters of all links. Each is exact, but they are not all of one instant.
struct Snapshot {
  // When the first packet came, in CLOCK_MONOTONIC; empty before it.
  std::optional<TimePoint> epoch;
  std::vector<LinkSnapshot> links;
  // In the order of the scenario's cells.
  std::vector<CellSnapshot> cells;

  // The following four are the emulator's and 0 with netem.
  // By how much frames were sent later than they were due, in microseconds.
  double lateness_mean_us = 0;
  double lateness_max_us = 0;
  std::uint64_t frames_sent = 0;
  // Frames lost between kernel and emulator, in either direction: 0 unless a sender floods or a NIC
  // was set down.
  std::uint64_t kernel_drops = 0;

  // The following three are netem's and 0 with the emulator; see NetemBackend::Effort.
  std::uint64_t netem_skipped = 0;
  std::uint64_t netem_put_off = 0;
  std::uint64_t netem_failed = 0;
};

}  // namespace interneuron::netns
