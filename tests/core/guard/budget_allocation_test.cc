// A guard's decisions cost no allocation once its books are open: levels, holds and the mode of the
// first transmission.
#include <gtest/gtest.h>

#include <vector>

#include "core/guard/observers.h"
#include "core/guard/origins.h"
#include "core/guard/residual_law.h"
#include "tests/counted_heap.h"

namespace interneuron::guard::budget_allocation_test {
namespace {

using namespace std::chrono_literals;

std::vector<LevelProfile> ladder() {
  return {{8ms, 10ms, {0.14, 0.13}}, {19ms, 24ms, {0.35, 0.33}}, {44ms, 46ms, {0.40, 0.38}}};
}

class Rounds {
 public:
  void run(int count) {
    for (int i = 0; i < count; ++i) round();
  }

 private:
  void round() {
    const TimePoint t0{number_ * 100ms};
    const RoundId round{number_};
    Forecast whole;
    Forecast small;
    whole[0] = 66ms;
    small[1] = 33ms;
    const Forecast modes[] = {whole, small};
    const bool degraded = origin_.choose_mode(t0, round, 1ms, modes) == 1;
    StageEnd up{.round = round,
                .t0 = as_wire(t0),
                .deadline = 130ms,
                .variant = 1,
                .best_planned = degraded ? 1 : 0,
                .degraded = degraded};
    up.terms.kind = GuardKind::kBudget;
    const TimePoint start = t0 + 40ms + number_ % 7 * 1ms;
    road_.note_arrival(start, up);
    road_.hold(start, up, std::nullopt, false);
    const LevelChoice choice = road_.begin_computation(start, up, {}, levels_, 2, {});
    const Duration takes = levels_[choice.level].median + number_ % 5 * 4ms;
    StageEnd done = up;
    done.stage = 2;
    done.is_computation = true;
    road_.end_stage(start + takes, done, std::nullopt);
    const Duration e2e = start + takes + 12ms - t0;
    Spent spent{.level = static_cast<std::uint8_t>(choice.level),
                .variant = degraded ? std::uint8_t{1} : std::uint8_t{0},
                .excess = choice.excess,
                .computed = takes};
    if (number_ % 11 == 0) {
      origin_.missed(t0 + 130ms, round);
      road_.settle(start + 100ms, round, RoundState::kMissed, kNever);
    } else {
      origin_.result(t0 + e2e, round, e2e, spent);
      road_.settle(start + 100ms, round, RoundState::kOnTime, e2e);
    }
    ++number_;
  }

  static PipelineConfig config() {
    return PipelineConfig{.guard = GuardKind::kBudget, .levels = ladder()};
  }
  std::vector<LevelProfile> levels_ = ladder();
  BudgetObserver road_;
  BudgetOrigin origin_{config()};
  std::uint32_t number_ = 0;
};

TEST(BudgetAllocation, DecisionsNeedNone) {
  Rounds rounds;
  rounds.run(20);
  const std::size_t before = allocations;
  rounds.run(2000);
  EXPECT_EQ(allocations, before);
}

TEST(BudgetAllocation, TheLawNeedsNone) {
  ResidualLaw law;
  const std::size_t before = allocations;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    ResidualLaw::Sample s{.round = RoundId{i}, .before = i % 17 * 1ms, .rest = 20ms + i % 13 * 1ms};
    law.add(TimePoint{i * 100ms}, s);
    static_cast<void>(law.near(s.before, 8ms).within(10ms));
    if (i % 500 == 499) law.drop_bases();
  }
  EXPECT_EQ(allocations, before);
}

// The paper's guard: reference time, stage deadline, level.
TEST(PaperAllocation, DecisionsNeedNone) {
  PaperObserver road;
  const std::vector<LevelProfile> levels = ladder();
  std::size_t before = 0;
  for (std::uint32_t i = 0; i < 300; ++i) {
    if (i == 20) before = allocations;
    const TimePoint t0{i * 100ms};
    StageEnd up{.round = RoundId{i}, .t0 = as_wire(t0), .x_permille = 200, .deadline = 130ms};
    const ClockView clock{};
    road.note_arrival(t0 + 30ms, up);
    static_cast<void>(road.hold(t0 + 30ms, up, clock, false));
    const Verdict verdict = road.end_stage(t0 + 30ms + i % 7 * 3ms, up, clock);
    static_cast<void>(road.begin_computation(t0 + 40ms, up, {}, levels, 2, verdict));
    road.settle(t0 + 120ms, RoundId{i}, RoundState::kOnTime, 100ms);
  }
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace interneuron::guard::budget_allocation_test
