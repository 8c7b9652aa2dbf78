// Estimates follow a link that falls far, and one that comes back.
#include <cstdio>

#include "duo.h"

namespace interneuron::sim {
namespace {

class SlowLink : public testing::TestWithParam<double> {};

// Beside a healthy link the fallen one is left within a few messages, which only its rate can tell.
TEST_P(SlowLink, ALinkThatFallsBelowAMegabitIsNoticed) {
  Duo duo({constant_link("a", 30, 60, 60), constant_link("b", 60, 20, 20)});
  duo.stream(2s, 230, 131'072);
  duo.change(5s, 0, {"up.rate_mbit=" + std::to_string(GetParam())});
  duo.world.run_until(11s);
  EXPECT_NEAR(duo.link(0).rate.mbit() / GetParam(), 1, 0.2);
  duo.world.run_until(27s);
  EXPECT_NEAR(duo.link(0).rate.mbit() / GetParam(), 1, 0.2);
  int missed = 0;
  for (const RoundDone& d : duo.done) missed += d.outcome == Outcome::kRemote ? 0 : 1;
  std::printf("%.1f Mbit/s: %.2f believed, %d missed\n", GetParam(), duo.link(0).rate.mbit(),
              missed);
  EXPECT_LE(missed, 10);
}

INSTANTIATE_TEST_SUITE_P(Measure, SlowLink, testing::Values(1.0, 0.5, 0.2), [](const auto& p) {
  return std::to_string(std::lround(p.param * 1000)) + "kbit";
});

}  // namespace
}  // namespace interneuron::sim
