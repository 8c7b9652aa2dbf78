// Readings of a running testbed: counters of its links, and what their models prescribed.
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
  emu::DirectionStats up;    // vehicle -> roadside; IP bytes
  emu::DirectionStats down;  // roadside -> vehicle
};

// What the model prescribed for one link at one of its steps (emu::kDelayStep).
struct ScheduleSample {
  Duration at{};   // since the epoch
  Duration rtt{};  // without queues
  double loss_up = 0;
  double loss_down = 0;
  DataRate rate_up{};
  DataRate rate_down{};
};

// A reading of the running links. Counters are each exact but not all of one instant.
struct Snapshot {
  std::optional<TimePoint> epoch;  // CLOCK_MONOTONIC of the first packet; empty before it
  std::vector<LinkSnapshot> links;
  // The emulator's alone, 0 with netem.
  double lateness_mean_us = 0;  // of frames: when sent minus when due
  double lateness_max_us = 0;
  std::uint64_t frames_sent = 0;
  // Frames lost between kernel and emulator, in either direction: 0 unless the sender floods or a
  // NIC was set down.
  std::uint64_t kernel_drops = 0;
  // netem's alone, 0 with the emulator.
  std::uint64_t netem_skipped = 0;  // steps that went by while one before was still at work
  std::uint64_t netem_put_off = 0;  // NICs that had to wait for the next step, summed over steps
  std::uint64_t netem_failed = 0;   // requests that the kernel refused
};

}  // namespace interneuron::netns
