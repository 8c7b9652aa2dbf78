#include "app/computing/computation_budget.h"

#include <gtest/gtest.h>

#include "core/plan/budget.h"

namespace interneuron::computing::computation_budget_test {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kInputBytes = 500'000;
constexpr std::size_t kResultBytes = 3'000;

std::vector<LinkState> one_link() {
  LinkState link{.up = true, .rtt_p50 = 10ms, .rate = DataRate::mbit(100)};
  return {link};
}

ComputationBudget estimated() {
  ComputationBudget budget(130ms);
  budget.estimate(one_link(), 1ms, kInputBytes, kResultBytes);
  return budget;
}

TEST(ComputationBudget, PromisesNothingBeforeTheLinksAreMeasured) {
  ComputationBudget budget(130ms);
  EXPECT_EQ(budget.value(), 0ms);
  budget.estimate({}, 1ms, kInputBytes, kResultBytes);
  EXPECT_EQ(budget.value(), 0ms);
}

TEST(ComputationBudget, IsWhatTheLinksLeaveLessThePreparation) {
  EXPECT_EQ(estimated().value(),
            plan::compute_budget(129ms, one_link(), kInputBytes, kResultBytes));
  EXPECT_GT(estimated().value(), 0ms);
}

TEST(ComputationBudget, TheFirstRoundsCorrectItDownwards) {
  ComputationBudget budget = estimated();
  const Duration before = budget.value();
  budget.learn(90ms);
  budget.learn(90ms);
  EXPECT_EQ(budget.value(), before) << "two rounds are too few";
  budget.learn(20ms);
  EXPECT_EQ(budget.value(), 130ms - 90ms - plan::kComputeReserve) << "by the median";
}

TEST(ComputationBudget, NeverGrowsAndIsNeverNegative) {
  ComputationBudget budget = estimated();
  const Duration before = budget.value();
  for (int i = 0; i < 3; ++i) budget.learn(0ms);
  EXPECT_EQ(budget.value(), before);
  for (int i = 0; i < 5; ++i) budget.learn(500ms);
  EXPECT_EQ(budget.value(), 0ms);
}

TEST(ComputationBudget, StaysAfterTheFirstRounds) {
  ComputationBudget budget = estimated();
  for (std::size_t i = 0; i < ComputationBudget::kRounds; ++i) budget.learn(80ms);
  const Duration learnt = budget.value();
  for (int i = 0; i < 50; ++i) budget.learn(120ms);
  EXPECT_EQ(budget.value(), learnt);
}

}  // namespace
}  // namespace interneuron::computing::computation_budget_test
