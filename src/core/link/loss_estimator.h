// Loss of one path: share of packets lost and mean length of a run of losses, from the outcomes of
// packets in the order of their numbers. Pure; thread-compatible; constant memory.
//
// The share is the plain mean of the first kMemory packets and an exponential mean over about as
// many after that; evidence also fades with time (kFade), so that an idle path forgets. A quicker
// mean beside it watches for steps: once the two differ by more than luck explains, the quick one
// takes over.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::link {

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
