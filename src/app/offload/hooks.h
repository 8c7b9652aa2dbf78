// What an evaluation may add to the programs `vehicle` and `road`, so that these know nothing of
// it: it derives from these classes, overrides what it needs and passes the object to run_vehicle()
// or run_road(), which calls the hooks while it runs. The base classes change nothing; a program
// that was given no hooks uses them.
//
// Ownership: the caller of run_vehicle() or run_road() keeps the hooks alive until that returns.
// Thread-safety: called on the node's thread, except where a function says otherwise.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/computing/roadside_unit.h"
#include "app/records/run_files.h"
#include "interneuron/node.h"

namespace interneuron::offload {

// Hooks of the vehicle.
class VehicleHooks {
 public:
  virtual ~VehicleHooks() = default;

  // Change what the options asked for. Called once each, before the node is made.
  virtual void configure(PipelineConfig&) const {}
  virtual void configure(NodeOptions&) const {}
  // Returns the variants of a round's image that are submitted, of those that were encoded (raw
  // first). Called when they are encoded, right before they are submitted.
  virtual Variants submitted(const RoundRef&, Variants variants) { return variants; }
  // Returns whether a local result is computed beside the remote one.
  virtual bool local_backup() const { return true; }
  // A round has its outcome.
  virtual void done(const RoundDone&, const records::RoundRow&) {}
  // The run is over; `links` has the final counters.
  virtual void finished(const std::vector<Statistics::Link>& /*links*/) {}
};

// Hooks of the roadside unit.
class RoadHooks {
 public:
  virtual ~RoadHooks() = default;

  // Changes what the options asked for. Called once, before the node is made.
  virtual void configure(NodeOptions&) const {}
  // Returns what is known of the levels' run times. If that is not empty, the ladder is neither
  // calibrated nor are run times learnt in operation.
  virtual std::span<const LevelProfile> levels() const { return {}; }
  // Pauses between the hand-over of an image and its computation, and inside the computation. The
  // second is asked for on the worker's thread.
  virtual Duration before_compute(RoundId) const { return {}; }
  virtual Duration inside_compute(RoundId) const { return {}; }
  // Returns the level, one of `levels`, for an image delivered at `delivered` whose computation
  // begins `now`; nothing to ask the guard.
  virtual std::optional<std::size_t> level(std::span<const LevelProfile> /*levels*/,
                                           TimePoint /*delivered*/, TimePoint /*now*/) const {
    return std::nullopt;
  }
  // The computation of a round has ended; its result is submitted next.
  virtual void computed(const computing::Computed&) {}
  // The unit was told to end.
  virtual void finished(const std::string& /*ladder*/, const std::vector<std::string>& /*names*/,
                        std::span<const LevelProfile> /*levels*/) {}
};

}  // namespace interneuron::offload
