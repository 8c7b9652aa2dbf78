// What each GuardKind stands for: its name, and its rules at an observing node and at the origin.
#include "core/guard/observers.h"
#include "core/guard/origins.h"

namespace interneuron {

std::string_view to_string(GuardKind kind) {
  return kind == GuardKind::kBudget ? "budget" : "paper";
}

namespace guard {

std::unique_ptr<StageGuard> make_stage_guard(GuardKind kind, bool at_origin,
                                             const Ablation& ablation) {
  if (kind == GuardKind::kBudget) return std::make_unique<BudgetObserver>();
  return std::make_unique<PaperObserver>(at_origin, ablation);
}

std::unique_ptr<RoundGuard> make_round_guard(const PipelineConfig& config,
                                             const Ablation& ablation) {
  if (config.guard == GuardKind::kBudget) return std::make_unique<BudgetOrigin>(config);
  return std::make_unique<PaperOrigin>(XController::Options{config.beta_permille, ablation});
}

}  // namespace guard
}  // namespace interneuron
