// Systems that an experiment compares, by name: ours, its ablations and the baselines
// (docs/evaluation.md, "Systems"). All run the same endpoints over the same links, with the same
// frames, delays, levels and computation.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/ablation.h"
#include "interneuron/pipeline.h"

namespace interneuron::eval {

// How the roadside chooses the level.
enum class LevelRule : std::uint8_t {
  // The guard chooses, by Endpoint::begin_computation().
  kGuard,
  // Always the highest one of the profile.
  kFixedTop,
  // The deadline of the computation is D_N - T1 - T3, counted from the arrival of its input
  // (docs/paper.md, "The baseline after ERDOS").
  kErdos,
  // The same with synchronised clocks: D_N - (now - t0) - T3.
  kErdosE2e,
  // The one that causal_player() takes, which also determines the variant. Only for scenarios for
  // which there is one.
  kCausal,
};

struct System {
  // "ours", "erdos_like", "no_handler" and so on: the same in every table and version.
  std::string name;
  // One line for tables and reports.
  std::string about;
  GuardKind guard = GuardKind::kPaper;
  std::string policy = "down_sampling";
  LevelRule level = LevelRule::kGuard;
  // Submits this variant alone.
  std::optional<std::uint8_t> only_variant;
  // Submits all variants; others the best one and Profile::sampled, as the paper.
  bool whole_ladder = false;
  // Has this link alone.
  std::optional<std::size_t> only_link;
  Ablation ablation{};
  // Without it, a missed round shows the last remote result.
  bool local_backup = true;
  // Whether it makes sense only where the best variant is a JPEG.
  bool needs_jpeg = false;
  // Whether it is no form of ours.
  bool is_baseline = false;
  // Whether it knows what no system can know, and is there to be compared with.
  bool is_bound() const { return level == LevelRule::kCausal; }
};

// All, in the order of the tables: ours (budget), paper, ablations no_x, no_handler, at_hand_over
// and above_zero (of paper, whose mechanisms they are), no_backup and one_link (of ours), baselines
// b0, erdos_like, erdos_e2e, duplicate, duplicate_e2e, causal_player, and the static choices
// always_sampled (B5), always_jpeg (B6; only with JPEG).
std::span<const System> systems();
const System* find_system(const std::string& name);

}  // namespace interneuron::eval
