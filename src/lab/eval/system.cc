#include "lab/eval/system.h"

#include <algorithm>

namespace interneuron::eval {
namespace {

// A link.
constexpr std::size_t kPrimary = 0;
// Variants: raw or its JPEG, and sampled.
constexpr std::uint8_t kBest = 0;
constexpr std::uint8_t kSmallest = 1;

System ours(std::string name, std::string about) {
  System s;
  s.name = std::move(name);
  s.about = std::move(about);
  s.guard = GuardKind::kBudget;
  return s;
}

System baseline(std::string name, std::string about, LevelRule level) {
  System s;
  s.name = std::move(name);
  s.about = std::move(about);
  s.policy = "best_link";
  s.level = level;
  s.only_variant = kBest;
  s.ablation = {.use_x = false, .use_handler = false};
  s.local_backup = false;
  s.is_baseline = true;
  return s;
}

std::vector<System> all() {
  std::vector<System> out;
  out.push_back(ours("ours", "guard budget, every link, local backup"));
  out.push_back(ours("paper", "the paper's guard, policy and handler"));
  out.back().guard = GuardKind::kPaper;
  // The ablations of the mechanisms that the paper's guard has.
  out.push_back(ours("no_x", "paper with X = 0"));
  out.back().guard = GuardKind::kPaper;
  out.back().ablation.use_x = false;
  out.push_back(ours("no_handler", "paper without the timeout handler"));
  out.back().guard = GuardKind::kPaper;
  out.back().ablation.use_handler = false;
  out.push_back(ours("at_hand_over", "paper that judges at the hand-over alone"));
  out.back().guard = GuardKind::kPaper;
  out.back().ablation.judge_at_start = false;
  out.push_back(ours("above_zero", "paper whose rounds with X < 0 stay out of the bases"));
  out.back().guard = GuardKind::kPaper;
  out.back().ablation.learn_below_zero = false;
  out.push_back(ours("no_backup", "ours without the local backup"));
  out.back().local_backup = false;
  out.push_back(ours("one_link", "ours on the primary link alone"));
  out.back().only_link = kPrimary;

  out.push_back(baseline("b0", "best image, highest level, one link", LevelRule::kFixedTop));
  out.back().only_link = kPrimary;
  out.push_back(baseline("erdos_like",
                         "deadline of the computation from the hand-over on, one link",
                         LevelRule::kErdos));
  out.back().only_link = kPrimary;
  out.push_back(
      baseline("erdos_e2e", "the same from t0 on by clocks in perfect step", LevelRule::kErdosE2e));
  out.back().only_link = kPrimary;
  out.push_back(baseline("duplicate",
                         "b0 over every link that can carry the image, first copy wins",
                         LevelRule::kFixedTop));
  out.back().policy = "duplicate";
  out.push_back(baseline("duplicate_e2e", "erdos_e2e over every link that can carry the image",
                         LevelRule::kErdosE2e));
  out.back().policy = "duplicate";
  out.push_back(baseline("always_sampled",
                         "always the sampled image over every link, highest level",
                         LevelRule::kFixedTop));
  out.back().policy = "duplicate";
  out.back().only_variant = kSmallest;
  out.back().local_backup = true;
  out.push_back(baseline("always_jpeg", "always the JPEG over every link, highest level",
                         LevelRule::kFixedTop));
  out.back().policy = "duplicate";
  out.back().needs_jpeg = true;
  out.back().local_backup = true;
  out.push_back(baseline("causal_player", "knows the law and all clocks, with carry-over",
                         LevelRule::kCausal));
  out.back().policy = "duplicate";
  out.back().only_variant.reset();
  out.back().local_backup = true;
  out.back().is_baseline = false;
  return out;
}

}  // namespace

std::span<const System> systems() {
  static const std::vector<System> kSystems = all();
  return kSystems;
}

const System* find_system(const std::string& name) {
  const auto it = std::ranges::find(systems(), name, &System::name);
  return it == systems().end() ? nullptr : &*it;
}

}  // namespace interneuron::eval
