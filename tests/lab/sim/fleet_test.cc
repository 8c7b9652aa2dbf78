// What one vehicle can do to the others by what it sends to be computed: nothing that a further
// honest vehicle would not do.
#include "tests/lab/sim/fleet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "support.h"

namespace interneuron::sim::fleet_test {
namespace {

// More misses of a vehicle than in the paired run without the attacker, as a share of its rounds.
constexpr double kMoreMisses = 0.01;
// The least share of the levels that honest vehicles get with an honest third one instead.
constexpr double kOfTheLevels = 0.97;
// The longest deadline that a pipeline may have.
constexpr Duration kEndless = 1h;
// A JPEG of a few pixels.
constexpr std::size_t kTinyImage = 316;

constexpr std::uint64_t kSeeds[] = {1, 2};

FleetOptions two_honest(std::uint64_t seed) {
  FleetOptions o;
  o.seed = seed;
  o.length = kSanitized ? 5s : 30s;
  o.link = constant_link("road", 20, 100, 100);
  o.vehicles.resize(2);
  o.vehicles[1].phase = 37ms;
  return o;
}

FleetOptions with(FleetOptions options, FleetVehicle third) {
  third.phase = 11ms;
  options.vehicles.push_back(std::move(third));
  return options;
}

FleetVehicle flooder(Duration period) {
  FleetVehicle v;
  v.variant_bytes = {kTinyImage};
  v.period = period;
  v.deadline = kEndless;
  v.budget = kEndless;
  return v;
}

std::string figures(const FleetOutcome& o) {
  return std::to_string(o.on_time) + " of " + std::to_string(o.rounds) + " on time, level " +
         std::to_string(o.mean_level()) + ", told " + std::to_string(o.told) + ", busy " +
         std::to_string(to_ms(o.work.busy)) + " ms";
}

// The two honest vehicles beside the attacker, against the pair alone and the pair with a third
// honest one.
void expect_harmless(const FleetVehicle& attacker, const std::string& name) {
  for (const std::uint64_t seed : kSeeds) {
    const FleetOptions honest = two_honest(seed);
    const auto alone = run_fleet(honest);
    const auto three = run_fleet(with(honest, {}));
    const auto attacked = run_fleet(with(honest, attacker));
    for (std::size_t i = 0; i < 2; ++i) {
      SCOPED_TRACE(name + ", seed " + std::to_string(seed) + ", vehicle " + std::to_string(i) +
                   "\n  alone:    " + figures(alone[i]) + "\n  three:    " + figures(three[i]) +
                   "\n  attacked: " + figures(attacked[i]) +
                   "\n  attacker: " + figures(attacked[2]));
      EXPECT_LE(attacked[i].miss_share(), alone[i].miss_share() + kMoreMisses);
      EXPECT_GE(attacked[i].mean_level(), kOfTheLevels * three[i].mean_level());
      EXPECT_EQ(attacked[i].strange, 0u);
      EXPECT_EQ(attacked[i].work.crowded_out, 0u);
    }
    EXPECT_EQ(attacked[2].strange, 0u);
  }
}

TEST(Fleet, HonestVehiclesAreServed) {
  for (const std::uint64_t seed : kSeeds) {
    for (const FleetOutcome& o : run_fleet(two_honest(seed))) {
      EXPECT_LE(o.miss_share(), 0.02) << figures(o);
      EXPECT_EQ(o.on_time + o.local, o.rounds);
      EXPECT_EQ(o.strange, 0u);
    }
  }
}

TEST(Fleet, TwentyTinyImagesASecondCostTheirSenderAlone) {
  expect_harmless(flooder(50ms), "20 images/s");
}

// With the deadline of an honest vehicle: how many endless rounds an endpoint holds for a peer is
// no matter of what they compute.
TEST(Fleet, AFloodOfTinyImagesCostsItsSenderAlone) {
  FleetVehicle attacker = flooder(4ms);
  attacker.deadline = FleetVehicle{}.deadline;
  expect_harmless(attacker, "250 images/s");
}

TEST(Fleet, ABurstOfImagesCostsItsSenderAlone) {
  FleetVehicle attacker = flooder(3s);
  attacker.burst = 60;
  expect_harmless(attacker, "60 images at once");
}

TEST(Fleet, ImagesThatTakeLongToDecodeCostTheirSender) {
  FleetVehicle attacker = flooder(50ms);
  attacker.readable = false;
  // What the decoder of the program `road` may take.
  attacker.decoding = 50ms;
  const FleetOptions honest = two_honest(1);
  const auto three = run_fleet(with(honest, {}));
  const auto attacked = run_fleet(with(honest, attacker));
  for (std::size_t i = 0; i < 2; ++i) {
    SCOPED_TRACE(figures(three[i]) + " / " + figures(attacked[i]));
    EXPECT_LE(attacked[i].miss_share(), three[i].miss_share() + kMoreMisses);
  }
  EXPECT_GT(attacked[2].told, attacked[2].rounds * 9 / 10) << figures(attacked[2]);
  EXPECT_EQ(attacked[2].on_time, 0u);
}

TEST(Fleet, ManyVehiclesShareAlike) {
  FleetOptions o = two_honest(1);
  o.vehicles.resize(8);
  for (std::size_t i = 0; i < o.vehicles.size(); ++i) {
    o.vehicles[i].phase = static_cast<Duration::rep>(i) * 13ms;
  }
  const auto outcomes = run_fleet(o);
  const auto [least, most] =
      std::ranges::minmax_element(outcomes, {}, [](const auto& v) { return v.work.busy; });
  EXPECT_GE(to_ms(least->work.busy), 0.9 * to_ms(most->work.busy));
  for (const FleetOutcome& v : outcomes) EXPECT_LE(v.miss_share(), 0.05) << figures(v);
}

TEST(Fleet, WhoIsToldThatThereIsNoAnswerTakesItsLocalOneAtOnce) {
  FleetOptions o = two_honest(1);
  o.vehicles[0].readable = false;
  o.vehicles[0].deadline = 5s;
  const auto outcomes = run_fleet(o);
  EXPECT_EQ(outcomes[0].on_time, 0u);
  EXPECT_EQ(outcomes[0].told, outcomes[0].rounds);
  EXPECT_EQ(outcomes[0].local, outcomes[0].rounds);
}

}  // namespace
}  // namespace interneuron::sim::fleet_test
