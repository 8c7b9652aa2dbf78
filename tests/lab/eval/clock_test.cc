// The evaluation's rounds do not depend on the roadside's clock (docs/paper.md, "Clock offset").
#include <algorithm>
#include <cstdio>

#include "support.h"

namespace interneuron::eval::clock_test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kRounds = kSanitized ? 40 : 150;

Run with_clock(const char* system, sim::ClockError road, std::uint64_t seed = 3) {
  Scenario scenario = table_erdos_scenario();
  scenario.road_clock = road;
  return run(named(system), scenario, make_trace(scenario.law, seed, kRounds), seed);
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

// A drift of any size, like anything else that moves a packet by a nanosecond, changes which rounds
// of a run are on time: of 150 some three more or fewer. So it is judged by many runs.
TEST(EvalClock, DriftCostsAtMostOnePercentOfTheRounds) {
  constexpr std::uint64_t kSeeds = kSanitized ? 2 : 24;
  for (const char* system : {"ours", "paper"}) {
    const auto sum = [system](std::int64_t ppm) {
      double rounds = 0;
      for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        rounds += on_time(with_clock(system, {0s, ppm}, seed));
      }
      return rounds;
    };
    const double plain = sum(0);
    for (const std::int64_t ppm : {200, -200}) {
      const double drifts = sum(ppm);
      std::printf("%s, %+d ppm: %.0f of %.0f\n", system, static_cast<int>(ppm), drifts, plain);
      EXPECT_NEAR(drifts, plain, 0.01 * kRounds * kSeeds + 0.5) << system << ", " << ppm << " ppm";
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
