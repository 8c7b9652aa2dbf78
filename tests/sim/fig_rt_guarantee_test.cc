// The paper's Fig. rt_guarantee (NOTES §5) through the production endpoints, on constant links with
// scripted extra delays: rounds 0-2 normal; 3-4 the raw image is slower but within D1; 5-7 it
// misses D1 and the sampled image is used at exactly D1; 8-12 both are slow, D1 is missed: a
// lighter model (8-9), the lightest (10-12); 11-12 D2 is missed too.
#include <cstdio>

#include "support.h"

namespace interneuron::sim {
namespace {

using namespace std::chrono_literals;

struct Extra {
  int raw_ms;      // on the link that carries the raw image
  int sampled_ms;  // on the other
};

constexpr Extra kScript[] = {{0, 0},   {0, 0},   {0, 0},     // normal
                             {4, 0},   {4, 0},               // slower, within D1
                             {60, 0},  {60, 0},  {60, 0},    // raw misses D1
                             {90, 22}, {90, 27},             // both slow
                             {90, 44}, {90, 66}, {90, 65}};  // seriously

TEST(FigRtGuarantee, ThePapersSequence) {
  OffloadOptions o;
  o.rounds = std::size(kScript);
  o.profiles = {constant_link("5g", 10, 100, 300), constant_link("4g", 30, 30, 75)};
  // Three sets of weights as in the paper: the lightest far quicker than the two others.
  o.ladder = {{"n", 5ms, 5ms}, {"l", 35ms, 35ms}, {"x6", 44ms, 44ms}};
  o.top_level = 2;
  o.compute_noise = false;
  o.repair = false;
  for (const Extra& extra : kScript) {
    Disturbance& round = o.disturbances.emplace_back();
    round.uplink = {extra.raw_ms * 1ms, extra.sampled_ms * 1ms};
  }
  const OffloadResult result = run_offload(o);
  for (const OffloadRound& r : result.rounds) {
    ASSERT_TRUE(r.at_road) << "round " << r.round;
    const auto& road = *r.at_road;
    std::printf(
        "%2u e2e %6.1f X %+.3f variant %d late %d overrun %5.1f at D1 %d level %zu D2 missed %d\n",
        r.round, to_ms(r.done.e2e), r.done.x_permille / 1000.0, road.variant, road.verdict.late,
        to_ms(road.verdict.overrun), road.verdict.released_at_deadline, road.level,
        r.done.degraded_final);
    EXPECT_EQ(r.done.outcome, Outcome::kRemote) << "round " << r.round;
    EXPECT_EQ(road.variant, r.round < 5 ? 0 : 1) << "round " << r.round;
    EXPECT_EQ(road.verdict.released_at_deadline, r.round >= 5 && r.round <= 7)
        << "round " << r.round;
    EXPECT_EQ(road.verdict.late, r.round >= 8) << "round " << r.round;
    EXPECT_EQ(road.level, r.round < 8 ? 2U : r.round < 10 ? 1U : 0U) << "round " << r.round;
    EXPECT_EQ(r.done.degraded_final, r.round >= 11) << "round " << r.round;
  }
  // The reference rises with the slower rounds, so X falls.
  EXPECT_LT(result.rounds[6].done.x_permille, result.rounds[3].done.x_permille);
}

}  // namespace
}  // namespace interneuron::sim
