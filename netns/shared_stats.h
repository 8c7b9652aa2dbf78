// What the emulator lets others read while it runs: one page or two of shared memory (memfd),
// written by the holder alone. Each counter is atomic; the whole is not, which is fine for a
// display. The layout is private to one build of the program; kVersion refuses another one's.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "emu/link_model.h"
#include "netns/testbed.h"

namespace interneuron::netns {

struct SharedDirection {
  std::atomic<std::uint64_t> packets_in{};
  std::atomic<std::uint64_t> bytes_in{};
  std::atomic<std::uint64_t> delivered{};
  std::atomic<std::uint64_t> bytes_delivered{};
  std::atomic<std::uint64_t> lost{};
  std::atomic<std::uint64_t> queue_drops{};

  void store(const emu::DirectionStats& stats) {
    packets_in.store(stats.packets_in, std::memory_order_relaxed);
    bytes_in.store(stats.bytes_in, std::memory_order_relaxed);
    delivered.store(stats.delivered, std::memory_order_relaxed);
    bytes_delivered.store(stats.bytes_delivered, std::memory_order_relaxed);
    lost.store(stats.lost, std::memory_order_relaxed);
    queue_drops.store(stats.queue_drops, std::memory_order_relaxed);
  }

  emu::DirectionStats load() const {
    emu::DirectionStats out;
    out.packets_in = packets_in.load(std::memory_order_relaxed);
    out.bytes_in = bytes_in.load(std::memory_order_relaxed);
    out.delivered = delivered.load(std::memory_order_relaxed);
    out.bytes_delivered = bytes_delivered.load(std::memory_order_relaxed);
    out.lost = lost.load(std::memory_order_relaxed);
    out.queue_drops = queue_drops.load(std::memory_order_relaxed);
    return out;
  }
};

struct SharedStats {
  static constexpr std::uint64_t kVersion = 0x696e7465'00000001;  // "inte", 1

  std::uint64_t version = kVersion;
  std::atomic<std::int64_t> epoch_ns{};  // CLOCK_MONOTONIC; 0: no packet yet
  std::atomic<std::uint64_t> frames_sent{};
  std::atomic<std::uint64_t> lateness_sum_ns{};
  std::atomic<std::uint64_t> lateness_max_ns{};
  std::atomic<std::uint64_t> kernel_drops{};
  std::array<SharedDirection, kMaxLinks> up{};
  std::array<SharedDirection, kMaxLinks> down{};
};

static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "a lock cannot be shared like this");

}  // namespace interneuron::netns
