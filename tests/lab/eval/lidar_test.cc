// The pipeline of point clouds in virtual time.
#include "lab/eval/lidar.h"

#include <cmath>

#include "lab/eval/bounds.h"
#include "lab/eval/metrics.h"
#include "perception/clusters.h"
#include "perception/point_cloud.h"
#include "support.h"

namespace interneuron::eval::lidar_test {
namespace {

constexpr LidarSweep kBoth[] = {LidarSweep::kKitti, LidarSweep::kNuScenes};

TEST(LidarProfile, IsThatOfTheRungsAndLevelsThereAre) {
  for (const LidarSweep sweep : kBoth) {
    const Profile p = lidar_profile(sweep);
    ASSERT_EQ(p.variants.size(), perception::cloud_rungs().size());
    ASSERT_EQ(p.levels.size(), perception::cluster_levels().size());
    for (std::size_t v = 0; v < p.variants.size(); ++v) {
      EXPECT_EQ(p.variants[v].name, perception::cloud_rungs()[v].name);
      if (v > 0) {
        EXPECT_LT(p.variants[v].bytes, p.variants[v - 1].bytes);
      }
    }
    for (std::size_t l = 0; l < p.levels.size(); ++l) {
      EXPECT_EQ(p.level_names[l], perception::cluster_levels()[l].name);
      EXPECT_EQ(p.levels[l].quality.size(), p.variants.size());
      EXPECT_LE(p.levels[l].median, p.levels[l].p95);
    }
    EXPECT_EQ(remote_quality(p, p.levels.size() - 1, 0), 1);
    // Nearer to a quarter of the bytes than its neighbours.
    const double quarter = static_cast<double>(p.variants[0].bytes) / 4;
    const auto apart = [&](std::size_t v) {
      return std::abs(std::log(static_cast<double>(p.variants[v].bytes) / quarter));
    };
    for (std::size_t v = 1; v < p.variants.size(); ++v) EXPECT_LE(apart(p.sampled), apart(v));
  }
}

System joint() {
  System system = named("ours");
  system.policy = "joint";
  system.whole_ladder = true;
  return system;
}

TEST(Lidar, TheSameSeedGivesTheSameRunAndNoSystemBeatsTheOracle) {
  for (const LidarSweep sweep : kBoth) {
    const Scenario scenario = lidar_scenario(sweep);
    const Trace trace = make_trace(scenario.law, 7, 60);
    const Bound best = oracle(scenario, trace, 7);
    for (const System& system :
         {named("ours"), joint(), named("paper"), named("erdos_like"), named("causal_player")}) {
      const std::vector<eval::Run> runs{run(system, scenario, trace, 7)};
      EXPECT_TRUE(runs[0].rounds == run(system, scenario, trace, 7).rounds) << system.name;
      const Figures f = figures(runs, scenario.profile);
      EXPECT_GE(f.timeouts, best.timeouts) << system.name;
      EXPECT_LE(f.quality, best.quality + 1e-9) << system.name;
    }
  }
}

// What is shown and planned is told by the profile's variants, of which most systems submit two.
TEST(Lidar, TellsWhichVariantOfTheLadderWasUsed) {
  const Scenario scenario = lidar_scenario(LidarSweep::kKitti);
  const Trace trace = make_trace({.shape = DelayLaw::Shape::kNone}, 1, 20);
  const auto last = [&](const System& system) {
    return run(system, scenario, trace, 1).rounds.back();
  };
  EXPECT_NE(last(named("ours")).plan.find("full:5g"), std::string::npos);
  EXPECT_NE(last(named("ours")).plan.find("20cm:4g"), std::string::npos)
      << last(named("ours")).plan;
  EXPECT_NE(last(joint()).plan.find("full:5g"), std::string::npos) << last(joint()).plan;
  System fixed = named("always_sampled");
  for (std::uint8_t v = 0; v < scenario.profile.variants.size(); ++v) {
    fixed.only_variant = v;
    const Round round = last(fixed);
    EXPECT_EQ(round.shown, (Shown{Shown::Kind::kRemote, 2, v, 0}));
    EXPECT_EQ(round.plan.substr(0, round.plan.find(':')), scenario.profile.variants[v].name);
  }
}

}  // namespace
}  // namespace interneuron::eval::lidar_test
