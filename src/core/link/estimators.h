// What is believed of one path by single figures that are told of it: its round trips, how long
// packets wait in queues, what is lost. Pure; thread-compatible.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/link/windowed_minimum.h"
#include "interneuron/time.h"

namespace interneuron::link {

// Round-trip times of one path: smoothed value and variation (RFC 6298 §2), exact quantiles of the
// last 2 s, minimum of the last 10 s.
//
// Owned and fed by the LinkEstimator of the path, at most a few hundred times a second. Memory
// doubles with the samples that a window has had so far: 2 KB for 20 a second, 12 KB at most;
// nothing is allocated once a window has been as full as it gets.
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

// How long packets wait in queues one way: their one-way delay above the smallest of the last 10 s.
// The delay may contain any offset between the two clocks, which cancels; a drift of 100 ppm adds
// 1 ms in 10 s.
//
// One direction of one path; owned and fed by its LinkEstimator. Constant memory.
class QueueSignal {
 public:
  // Queues fill and drain within this, so that older samples say nothing of now. No measurement
  // behind this value: it only has to be larger than the interval of idle heartbeats, 300 ms.
  static constexpr Duration kFresh = std::chrono::seconds(2);

  // Own or peer's receive instant minus the other's send instant; any int64, wrapping. With the
  // clock exchange of docs/paper.md, "Clock offset": up = (u - h) - s, down = r - u.
  void add(TimePoint now, Duration one_way);
  // Smoothed with gain 1/4; zero while unknown or when the newest sample is older than kFresh.
  Duration queue(TimePoint now) const;
  // The same as far as it can be there still: what waited when the newest sample came has left
  // since then, or there would be newer ones.
  Duration left(TimePoint now) const;
  // A clock stepped: old and new delays cannot be compared.
  void reset() { *this = {}; }

 private:
  WindowedMinimum minimum_;
  bool any_ = false;
  TimePoint at_{};
  Duration smoothed_{};
};

// Loss of one path: share of packets lost and mean length of a run of losses, from the outcomes of
// packets in the order of their numbers. Constant memory.
//
// The share is the plain mean of the first kMemory packets and an exponential mean over about as
// many after that; evidence also fades with time (kFade), so that an idle path forgets. A quicker
// mean beside it watches for steps: once the two differ by more than luck explains, the quick one
// takes over.
//
// Owned by the LinkEstimator of the path, which feeds it what the peer's reports settle.
class LossEstimator {
 public:
  // Packets that the mean remembers. At 5 % loss its standard error is 0.16 percentage points (an
  // exponential mean over n is as sure as a plain one over 2n), a third of half a point.
  static constexpr double kMemory = 10'000;
  // Packets that the quicker mean remembers: after so many it has seen 63 % of a step.
  static constexpr double kQuickMemory = 1'000;
  // Evidence this old weighs 1/e. The window in which outages are counted, too.
  static constexpr Duration kFade = std::chrono::seconds(60);

  // Outcomes of packets in the order of their numbers: so many in a row arrived, or were lost.
  // Losses reported in several calls without an arrival between them are one run.
  void arrived(TimePoint now, std::uint64_t packets);
  void lost(TimePoint now, std::uint64_t packets);

  // The share of packets lost, in [0, 1]; 0 while nothing is known.
  double loss() const { return slow_; }
  // The same over the newest packets alone: about kQuickMemory, at most.
  double quick_loss() const { return quick_; }
  double quick_packets() const { return quick_weight_; }
  // Mean number of packets lost in a row, over about the last 32 runs; 0 while none was lost.
  double burst() const;
  // How much the length of runs varies (standard deviation); negative while few runs are known.
  double burst_deviation() const;
  // Packets that the estimate rests on now; at most kMemory.
  double packets() const { return weight_; }

 private:
  void fade(TimePoint now);
  void close_run();
  void follow_steps();

  double slow_ = 0;
  double quick_ = 0;
  double weight_ = 0;
  double quick_weight_ = 0;
  double burst_ = 0;
  double burst_variance_ = 0;
  double runs_ = 0;
  // Packets lost in the run that is not over yet.
  std::uint64_t run_ = 0;
  std::optional<TimePoint> faded_at_;
};

}  // namespace interneuron::link
