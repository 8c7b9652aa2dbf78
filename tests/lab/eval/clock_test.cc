// The evaluation's rounds do not depend on the roadside's clock (docs/paper.md, "Clock offset").
#include <algorithm>

#include "support.h"

namespace interneuron::eval::clock_test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kRounds = kSanitized ? 40 : 150;

Run with_clock(const char* system, sim::ClockError road,
               std::optional<std::pair<std::uint32_t, Duration>> step = {}) {
  Scenario scenario = table_erdos_scenario();
  scenario.road_clock = road;
  scenario.clock_step = step;
  return run(named(system), scenario, make_trace(scenario.law, 3, kRounds), 3);
}

double on_time(const Run& r) {
  return static_cast<double>(std::ranges::count_if(r.rounds, &Round::on_time));
}

TEST(EvalClock, AnyOffsetGivesTheSameRounds) {
  for (const char* system : {"ours", "paper"}) {
    const eval::Run plain = with_clock(system, {});
    for (const Duration offset : {Duration(1h), Duration(-1h), Duration(24h), Duration(-24h)}) {
      EXPECT_TRUE(with_clock(system, {offset, 0}).rounds == plain.rounds)
          << system << ", off by " << offset.count() << " ns";
    }
  }
}

TEST(EvalClock, DriftCostsAtMostOnePercentOfTheRounds) {
  for (const char* system : {"ours", "paper"}) {
    const eval::Run plain = with_clock(system, {});
    for (const std::int64_t ppm : {200, -200}) {
      EXPECT_NEAR(on_time(with_clock(system, {0s, ppm})), on_time(plain), 0.01 * kRounds + 0.5)
          << system << ", " << ppm << " ppm";
    }
  }
}

// On rounds that nothing else disturbs.
TEST(EvalClock, AStepDisturbsTwoRoundsAtMost) {
  for (const char* system : {"ours", "paper"}) {
    for (const Duration by : {Duration(5s), Duration(-5s)}) {
      Scenario scenario = table_erdos_scenario();
      scenario.clock_step = {{20, by}};
      const eval::Run r = run(named(system), scenario, script(60, {}), 3);
      EXPECT_GE(on_time(r), 58) << system << ", " << by.count() << " ns";
    }
  }
}

}  // namespace
}  // namespace interneuron::eval::clock_test
