// Round-trip times of one path: smoothed value and variation (RFC 6298 §2), exact quantiles of the
// last 2 s, minimum of the last 10 s.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/link/windowed_minimum.h"
#include "interneuron/time.h"

namespace interneuron::link {

// Owned and fed by the LinkEstimator of the path, at most a few hundred times a second. Memory
// doubles with the samples that a window has had so far: 2 KB for 20 a second, 12 KB at most. Pure;
// thread-compatible; nothing is allocated once a window has been as full as it gets.
class RttEstimator {
 public:
  // Round trips older than this say nothing of now: a radio's bad episodes begin within a second
  // (docs/constants.md, "Three-state model").
  static constexpr Duration kQuantileWindow = std::chrono::seconds(2);
  // Quantiles are exact (nearest rank) up to 256 samples per second: feedback every 5 ms
  // is 200. Faster samples push the oldest out early: the window is then the newest 512.
  static constexpr std::size_t kCapacity = 512;

  // Round trips follow from what a peer writes and may be anything: one below zero counts as zero,
  // one above a minute as a minute.
  void add(TimePoint now, Duration rtt);

  bool measured() const { return count_ > 0; }
  // All zero while nothing was measured.
  // SRTT and RTTVAR, with gains of 1/8 and 1/4.
  Duration smoothed() const { return smoothed_; }
  Duration variation() const { return variation_; }
  // Smoothed with a gain of 1/4, to plan with: at 20 samples per second it follows a radio whose
  // delay rises within 0.1 to 0.3 s.
  Duration quick() const { return quick_; }
  // The quantile q, in (0, 1], by nearest rank, of the samples that are no older than
  // kQuantileWindow at `now`. When none is left, the newest sample stands for them; LinkState::age
  // tells how old it is.
  Duration quantile(TimePoint now, double q) const;
  // The smallest sample of the last 9 to 10 s; the newest one when none is left.
  Duration minimum(TimePoint now) const;
  // How many samples the quantiles rest on.
  std::size_t samples(TimePoint now) const;

 private:
  struct Sample {
    TimePoint at{};
    // The value and a sequence number, so that keys are unique and ordered by value.
    std::uint64_t key = 0;
  };
  // The number of slots is a power of two.
  Sample& slot(std::size_t i) { return ring_[(first_ + i) & (ring_.size() - 1)]; }
  const Sample& oldest(std::size_t i) const { return ring_[(first_ + i) & (ring_.size() - 1)]; }
  void pop_oldest();
  void grow();
  std::size_t expired(TimePoint now) const;
  void insert(std::uint64_t key);
  void replace(std::uint64_t old_key, std::uint64_t key);
  void erase(std::uint64_t key);

  // The samples, oldest first from first_ on; and their keys in order, in as many slots.
  std::vector<Sample> ring_;
  std::vector<std::uint64_t> sorted_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t sequence_ = 0;
  Duration smoothed_{};
  Duration variation_{};
  Duration quick_{};
  Duration newest_{};
  WindowedMinimum minimum_;
};

}  // namespace interneuron::link
