// The shared memory (memfd) by which other processes read a running testbed's counters: one
// SharedStats, followed by one SharedLink per link. The holder alone writes; readers map it
// read-only, so they can change nothing. Each value is atomic, but values read one after the other
// are not of one instant, which suffices for a display. The layout is private to one build of the
// program: readers refuse memory with another kVersion.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <new>

#include "lab/emu/conditions.h"
#include "lab/emu/link_model.h"
#include "lab/emu/scenario.h"

namespace interneuron::netns {

// The counters of one direction of a link.
struct SharedDirection {
  // Which field of DirectionStats each element of `values` is.
  static constexpr std::array kCounters{
      &emu::DirectionStats::packets_in, &emu::DirectionStats::bytes_in,
      &emu::DirectionStats::delivered,  &emu::DirectionStats::bytes_delivered,
      &emu::DirectionStats::lost,       &emu::DirectionStats::queue_drops,
      &emu::DirectionStats::duplicated, &emu::DirectionStats::corrupted,
      &emu::DirectionStats::reordered,  &emu::DirectionStats::outage_lost,
      &emu::DirectionStats::too_big,    &emu::DirectionStats::nat_drops,
      &emu::DirectionStats::policed};
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

// What the carrier of one direction does beside delay, loss and rate: these fields of
// DirectionParams as they are now.
struct SharedCarrier {
  std::atomic<std::int64_t> police_bits_per_second{};
  std::atomic<std::uint64_t> police_bytes{};
  std::atomic<std::int64_t> shape_bits_per_second{};
  std::atomic<std::uint64_t> shape_bytes{};
  std::atomic<std::int64_t> grant_every_ns{};
  std::atomic<double> grant_share{};
  std::atomic<double> harq{};
  std::atomic<std::int64_t> harq_by_ns{};
  std::atomic<std::int64_t> wake_after_ns{};
  std::atomic<std::int64_t> wake_by_ns{};

  void store(const emu::DirectionParams& params) {
    constexpr auto kRelaxed = std::memory_order_relaxed;
    police_bits_per_second.store(params.police.rate.bits_per_second, kRelaxed);
    police_bytes.store(params.police.bytes, kRelaxed);
    shape_bits_per_second.store(params.shape.rate.bits_per_second, kRelaxed);
    shape_bytes.store(params.shape.bytes, kRelaxed);
    grant_every_ns.store(params.grant_every.count(), kRelaxed);
    grant_share.store(params.grant_share, kRelaxed);
    harq.store(params.harq, kRelaxed);
    harq_by_ns.store(params.harq_by.count(), kRelaxed);
    wake_after_ns.store(params.wake_after.count(), kRelaxed);
    wake_by_ns.store(params.wake_by.count(), kRelaxed);
  }

  emu::DirectionParams load() const {
    emu::DirectionParams out;
    out.police = {DataRate{police_bits_per_second}, police_bytes};
    out.shape = {DataRate{shape_bits_per_second}, shape_bytes};
    out.grant_every = Duration{grant_every_ns};
    out.grant_share = grant_share;
    out.harq = harq;
    out.harq_by = Duration{harq_by_ns};
    out.wake_after = Duration{wake_after_ns};
    out.wake_by = Duration{wake_by_ns};
    return out;
  }
};

// What one direction of a cell has carried; the fields of CellDirection (netns/state/snapshot.h).
struct SharedCell {
  std::atomic<std::uint64_t> packets_in{};
  std::atomic<std::uint64_t> bytes_delivered{};
  std::atomic<std::uint64_t> dropped{};
  std::atomic<std::uint64_t> marked{};
  std::atomic<std::int64_t> queue_p99_ns{};
  std::atomic<std::int64_t> queue_mean_ns{};
  std::atomic<double> utilisation{};
};

// What the model prescribed at one step: the fields of ScheduleSample as integers. Loss is in
// millionths, rates are in kbit/s.
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
  SharedCarrier carrier_up;
  SharedCarrier carrier_down;
  // How many steps of 10 ms are kept: 82 s.
  static constexpr std::size_t kSteps = 8192;
  // How many steps have been written so far. Step n is at samples[n % kSteps].
  std::atomic<std::int64_t> steps{};
  std::array<SharedSample, kSteps> samples{};
};

struct SharedStats {
  // The letters "inte" and the number of this layout, 6.
  static constexpr std::uint64_t kVersion = 0x696e7465'00000006;

  std::uint64_t version = kVersion;
  std::uint64_t links = 0;
  // When the first packet came, in CLOCK_MONOTONIC; 0 before.
  std::atomic<std::int64_t> epoch_ns{};
  // The rest is explained at Snapshot (netns/state/snapshot.h).
  std::atomic<std::uint64_t> frames_sent{};
  std::atomic<std::uint64_t> lateness_sum_ns{};
  std::atomic<std::uint64_t> lateness_max_ns{};
  std::atomic<std::uint64_t> kernel_drops{};
  std::atomic<std::uint64_t> netem_skipped{};
  std::atomic<std::uint64_t> netem_put_off{};
  std::atomic<std::uint64_t> netem_failed{};
  // First up, then down, of each cell of the scenario.
  std::uint64_t cells = 0;
  std::array<SharedCell, emu::kDirections * emu::kMaxScenarioCells> cell{};

  static std::size_t bytes(std::size_t link_count) {
    return sizeof(SharedStats) + link_count * sizeof(SharedLink);
  }
  // The links lie behind this struct, in the same memory.
  SharedLink& link(std::size_t index) { return reinterpret_cast<SharedLink*>(this + 1)[index]; }
  const SharedLink& link(std::size_t index) const {
    return reinterpret_cast<const SharedLink*>(this + 1)[index];
  }
  // Constructs a SharedStats with its links in `memory`, which has bytes(link_count) zero bytes.
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
