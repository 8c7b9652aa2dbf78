// What the holder lets others read while it runs: shared memory (memfd), written by the holder
// alone: one SharedStats, then a SharedLink per link. Each value is atomic; the whole is not, which
// is fine for a display. The layout is private to one build of the program; kVersion refuses
// another one's.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <new>

#include "lab/emu/link_model.h"

namespace interneuron::netns {

struct SharedDirection {
  // In the order of kCounters.
  static constexpr std::array kCounters{
      &emu::DirectionStats::packets_in, &emu::DirectionStats::bytes_in,
      &emu::DirectionStats::delivered,  &emu::DirectionStats::bytes_delivered,
      &emu::DirectionStats::lost,       &emu::DirectionStats::queue_drops,
      &emu::DirectionStats::duplicated, &emu::DirectionStats::corrupted,
      &emu::DirectionStats::reordered,  &emu::DirectionStats::outage_lost,
      &emu::DirectionStats::too_big,    &emu::DirectionStats::nat_drops};
  std::array<std::atomic<std::uint64_t>, kCounters.size()> values{};

  void store(const emu::DirectionStats& stats) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i].store(stats.*kCounters[i], std::memory_order_relaxed);
    }
  }

  emu::DirectionStats load() const {
    emu::DirectionStats out;
    for (std::size_t i = 0; i < values.size(); ++i) {
      out.*kCounters[i] = values[i].load(std::memory_order_relaxed);
    }
    return out;
  }
};

// ScheduleSample of one step.
struct SharedSample {
  std::atomic<std::uint32_t> rtt_us{};
  std::atomic<std::uint32_t> loss_up_ppm{};
  std::atomic<std::uint32_t> loss_down_ppm{};
  std::atomic<std::uint32_t> rate_up_kbit{};
  std::atomic<std::uint32_t> rate_down_kbit{};
};

struct SharedLink {
  SharedDirection up;
  SharedDirection down;
  // The newest steps: step n of the process is at n % kSteps.
  static constexpr std::size_t kSteps = 8192;  // 82 s: `testbed verify` looks back 60 s
  std::atomic<std::int64_t> steps{};           // made so far
  std::array<SharedSample, kSteps> samples{};
};

struct SharedStats {
  static constexpr std::uint64_t kVersion = 0x696e7465'00000004;  // "inte", 4

  std::uint64_t version = kVersion;
  std::uint64_t links = 0;
  std::atomic<std::int64_t> epoch_ns{};  // CLOCK_MONOTONIC; 0: no packet yet
  std::atomic<std::uint64_t> frames_sent{};
  std::atomic<std::uint64_t> lateness_sum_ns{};
  std::atomic<std::uint64_t> lateness_max_ns{};
  std::atomic<std::uint64_t> kernel_drops{};
  std::atomic<std::uint64_t> netem_skipped{};
  std::atomic<std::uint64_t> netem_put_off{};
  std::atomic<std::uint64_t> netem_failed{};

  static std::size_t bytes(std::size_t link_count) {
    return sizeof(SharedStats) + link_count * sizeof(SharedLink);
  }
  // Behind this struct, in the same memory.
  SharedLink& link(std::size_t index) { return reinterpret_cast<SharedLink*>(this + 1)[index]; }
  const SharedLink& link(std::size_t index) const {
    return reinterpret_cast<const SharedLink*>(this + 1)[index];
  }
  // Puts one into `memory`, which has bytes(link_count) and is zero.
  static SharedStats* construct(void* memory, std::size_t link_count) {
    auto* stats = new (memory) SharedStats;
    stats->links = link_count;
    for (std::size_t i = 0; i < link_count; ++i) new (&stats->link(i)) SharedLink;
    return stats;
  }
};

static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "a lock cannot be shared like this");
static_assert(sizeof(SharedStats) % alignof(SharedLink) == 0);

}  // namespace interneuron::netns
