// Round-trip times of one path: smoothed value and variation (RFC 6298 §2), exact quantiles of the
// last 2 s, minimum of the last 10 s. Pure; thread-compatible; no allocation after construction.
#pragma once

#include <array>
#include <cstdint>

#include "core/link/windowed_minimum.h"
#include "interneuron/time.h"

namespace interneuron::link {

class RttEstimator {
 public:
  // Round trips older than this say nothing of now: a radio's bad episodes begin within a second
  // (docs/constants.md, "Three-state model").
  static constexpr Duration kQuantileWindow = std::chrono::seconds(2);
  // Quantiles are exact (nearest rank) up to 256 samples per second: feedback every 5 ms
  // is 200. Faster samples push the oldest out early: the window is then the newest 512.
  static constexpr std::size_t kCapacity = 512;

  // The peer's clock exchange may be anything: below zero counts as zero, above a minute as a
  // minute.
  void add(TimePoint now, Duration rtt);

  bool measured() const { return count_ > 0; }
  // All zero while nothing was measured.
  Duration smoothed() const { return smoothed_; }    // SRTT, gain 1/8
  Duration variation() const { return variation_; }  // RTTVAR, gain 1/4
  // Smoothed with gain 1/4: follows a radio's ramp of 0.1 to 0.3 s at 20 samples per second; for
  // scheduling.
  Duration quick() const { return quick_; }
  // Of the samples that are no older than kQuantileWindow at `now`; when none is left, the newest
  // sample stands for itself (its age is told elsewhere). q in (0, 1], nearest rank.
  Duration quantile(TimePoint now, double q) const;
  // Of the last 9 to 10 s; the newest sample when none is left.
  Duration minimum(TimePoint now) const;
  std::size_t samples(TimePoint now) const;  // how many the quantiles rest on

 private:
  struct Sample {
    TimePoint at{};
    std::uint64_t key = 0;  // value and sequence number: unique, ordered by value
  };
  const Sample& oldest(std::size_t i) const { return ring_[(first_ + i) % kCapacity]; }
  std::size_t expired(TimePoint now) const;
  void insert(std::uint64_t key);
  void replace(std::uint64_t old_key, std::uint64_t key);
  void erase(std::uint64_t key);

  std::array<Sample, kCapacity> ring_{};           // oldest first, from first_
  std::array<std::uint64_t, kCapacity> sorted_{};  // the same keys in order
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
