// Links that are granted in bursts, or shaped by a token bucket, are believed to carry what they
// carry, and used.
#include "echo_duo.h"
#include "lab/sim/duo.h"

namespace interneuron::sim::grants_test {
namespace {

constexpr double kMbit = 30;

emu::LinkProfile granted(Duration every) {
  emu::LinkProfile link = constant_link("a", 40, kMbit, 60);
  link.up.grant_every = every;
  return link;
}

class Grants : public testing::TestWithParam<Duration> {};

// Nine tenths of the rate at 10 Hz, so that a message takes 90 ms of its 150 at the rate.
TEST_P(Grants, TheRateIsThatOfManyGrants) {
  const std::size_t bytes = 316'000;
  Duo duo({granted(GetParam())}, {.variants = {bytes}, .deadline = 150ms});
  duo.send(Duo::kBegin, kSanitized ? 60 : 230);
  duo.run();
  EXPECT_NEAR(duo.link(0).rate.mbit(), kMbit, 0.2 * kMbit);
  EXPECT_LE(duo.missed(30), 2U);
}

// Each message drains the bucket, which is full again before the next one.
TEST(Buckets, TheRateIsThatAtWhichTheyFill) {
  constexpr double kFill = 10;
  for (const std::size_t kbyte : {8U, 32U}) {
    emu::LinkProfile link = constant_link("a", 40, 100, 60);
    link.up.shape = {DataRate::mbit(kFill), kbyte * 1000};
    Duo duo({link}, {.variants = {82'000}, .deadline = 150ms});
    duo.send(Duo::kBegin, kSanitized ? 60 : 230);
    duo.run();
    EXPECT_NEAR(duo.link(0).rate.mbit(), kFill, 0.2 * kFill) << kbyte;
    EXPECT_EQ(duo.missed(30), 0U) << kbyte;
  }
}

INSTANTIATE_TEST_SUITE_P(Measure, Grants, testing::Values(5ms, 10ms, 20ms), [](const auto& p) {
  return std::to_string(std::lround(to_ms(p.param))) + "ms";
});

}  // namespace
}  // namespace interneuron::sim::grants_test
