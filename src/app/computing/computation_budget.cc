#include "app/computing/computation_budget.h"

#include <algorithm>

#include "core/base/statistics.h"
#include "core/plan/budget.h"

namespace interneuron::computing {

void ComputationBudget::estimate(std::span<const LinkState> links, Duration preparation,
                                 std::size_t input_bytes, std::size_t result_bytes) {
  budget_ = plan::compute_budget(deadline_ - preparation, links, input_bytes, result_bytes);
}

void ComputationBudget::learn(Duration overhead) {
  if (overheads_.size() >= kRounds) return;
  overheads_.push_back(overhead);
  if (overheads_.size() < kFewest) return;
  const Duration left = deadline_ - percentile(overheads_, 0.5) - plan::kComputeReserve;
  budget_ = std::clamp(left, Duration{}, budget_);
}

}  // namespace interneuron::computing
