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
