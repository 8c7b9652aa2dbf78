// What somebody else than the user may add to the programs `vehicle` and `road`: an evaluation that
// runs them derives from these classes and overrides what it needs. Without hooks the programs use
// the base classes, which change nothing.
//
// Ownership: the caller of run_vehicle() or run_road() keeps the hooks alive until that returns.
// Thread-safety: called on the node's thread, except where a function says otherwise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "interneuron/node.h"
#include "lab/files/run_files.h"

namespace interneuron::cli {

// Hooks of the vehicle.
class VehicleHooks {
 public:
  virtual ~VehicleHooks() = default;

  // Called once each, before the node is made, on what the options asked for.
  virtual void configure(PipelineConfig&) const {}
  virtual void configure(NodeOptions&) const {}
  // The variants that are submitted, of those that were encoded (raw first).
  virtual Variants submitted(Variants variants) const { return variants; }
  // Whether a local result is computed beside the remote one.
  virtual bool local_backup() const { return true; }
  // A round has its outcome.
  virtual void done(const RoundDone&, const RoundRow&) {}
  // The run is over; `links` has the final counters.
  virtual void finished(const std::vector<Statistics::Link>& /*links*/) {}
};

// One computation of the roadside unit. Instants are of its node's clock.
struct Computed {
  RoundId round{};
  std::uint8_t variant = 0;
  std::size_t level = 0;
  bool degraded = false;
  TimePoint delivered{};  // the image was handed over
  TimePoint began{};
  TimePoint ended{};
};

// Hooks of the roadside unit.
class RoadHooks {
 public:
  virtual ~RoadHooks() = default;

  // Called once, before the node is made.
  virtual void configure(NodeOptions&) const {}
  // What is known of the levels' run times; not empty: the ladder is not calibrated, and run times
  // in operation are not learnt.
  virtual std::span<const LevelProfile> levels() const { return {}; }
  // Pauses between the hand-over of an image and its computation, and inside the computation. The
  // second is asked for on the worker's thread.
  virtual Duration before_compute(RoundId) const { return {}; }
  virtual Duration inside_compute(RoundId) const { return {}; }
  // The level for an image delivered at `delivered` whose computation begins `now`; nothing: the
  // guard is asked.
  virtual std::optional<std::size_t> level(std::span<const LevelProfile> /*levels*/,
                                           TimePoint /*delivered*/, TimePoint /*now*/) const {
    return std::nullopt;
  }
  virtual void computed(const Computed&) {}
  // The unit was told to end.
  virtual void finished(const std::string& /*ladder*/, const std::vector<std::string>& /*names*/,
                        std::span<const LevelProfile> /*levels*/) {}
};

}  // namespace interneuron::cli
