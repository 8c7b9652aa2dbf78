// Several vehicles and one roadside unit that computes for all of them, in virtual time: what one
// of them does to the others. Endpoints, policies, guards, links and computing::RoadsideUnit are
// the production code, with the rules that the program `road` has; only decoding and detection are
// replaced by times. offload.h has one vehicle and all that an evaluation asks of it.
//
// Pure and seeded: the same options give the same run to the last bit. Thread-compatible.
#pragma once

#include <cstdint>
#include <vector>

#include "app/computing/jobs.h"
#include "interneuron/round.h"
#include "lab/emu/link.h"
#include "lab/sim/offload.h"

namespace interneuron::sim {

// One vehicle, honest by default: it has one link of its own to the roadside unit, sends its
// variants each period and has a local backup.
struct FleetVehicle {
  std::vector<std::size_t> variant_bytes = OffloadOptions{}.variant_bytes;
  Duration period = std::chrono::milliseconds(100);
  Duration deadline = std::chrono::milliseconds(130);
  // Images that it sends at once, each as a round of its own.
  std::uint32_t burst = 1;
  // The time that it says it can afford for the computation.
  Duration budget = std::chrono::milliseconds(60);
  // How long decoding takes, and whether an image comes out.
  Duration decoding{};
  bool readable = true;
  // When it begins its first round, after the warm-up: so that vehicles do not begin together.
  Duration phase{};
};

struct FleetOptions {
  std::uint64_t seed = 1;
  std::vector<FleetVehicle> vehicles;
  // Rounds begin for so long.
  Duration length = std::chrono::seconds(30);
  emu::LinkProfile link;
  std::vector<LevelRuntime> ladder = default_ladder();
  computing::UnitRules rules{};
};

// What came of a vehicle's rounds.
struct FleetOutcome {
  std::uint32_t rounds = 0;
  std::uint32_t on_time = 0;
  // Rounds of which the roadside unit said that they get no result.
  std::uint32_t told = 0;
  // Rounds that were answered locally.
  std::uint32_t local = 0;
  // Answers that belong to no round of the vehicle, or more than one to a round: 0.
  std::uint32_t strange = 0;
  // The level of each result that was on time.
  std::vector<std::size_t> levels;
  // What the unit did for it.
  computing::PeerWork work;

  double miss_share() const {
    return rounds == 0 ? 0 : static_cast<double>(rounds - on_time) / static_cast<double>(rounds);
  }
  double mean_level() const;
};

// One outcome for each vehicle, in their order.
std::vector<FleetOutcome> run_fleet(const FleetOptions& options);

}  // namespace interneuron::sim
