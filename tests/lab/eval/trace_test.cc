// The injected delays follow their law.
#include "lab/eval/trace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace interneuron::eval::trace_test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kMany = 100'000;

TEST(Trace, HasTheShareAndTheBurstsOfTheLaw) {
  for (const double share : {0.1, 0.5, 0.72, 0.9}) {
    DelayLaw law{.share = share};
    const Trace trace = make_trace(law, 1, kMany);
    std::uint32_t injected = 0;
    std::uint32_t bursts = 0;
    for (std::uint32_t i = 0; i < kMany; ++i) {
      if (!trace.rounds[i].any) continue;
      ++injected;
      if (i == 0 || !trace.rounds[i - 1].any) ++bursts;
    }
    EXPECT_NEAR(injected / double{kMany}, share, 0.01);
    // Within four standard errors of the mean of a geometric length.
    const double burst = share > 0.8 ? share / (1 - share) : 4.0;
    EXPECT_NEAR(injected / double(bursts), burst, 4 * burst / std::sqrt(double(bursts)));
  }
}

TEST(Trace, DrawsModulesAlikeAndDelaysByTheirShape) {
  DelayLaw law{.share = 1};
  std::array<std::uint32_t, kModules> modules{};
  Duration sum{};
  for (const Injected& r : make_trace(law, 2, kMany).rounds) {
    ASSERT_TRUE(r.any);
    EXPECT_GE(r.delay, 15ms);
    EXPECT_LT(r.delay, 50ms);
    ++modules[static_cast<std::size_t>(r.module)];
    sum += r.delay;
  }
  for (const std::uint32_t count : modules) EXPECT_NEAR(count / double{kMany}, 0.25, 0.01);
  EXPECT_NEAR(to_ms(sum) / kMany, 32.5, 0.2);

  law.shape = DelayLaw::Shape::kExponential;
  sum = {};
  for (const Injected& r : make_trace(law, 2, kMany).rounds) sum += r.delay;
  EXPECT_NEAR(to_ms(sum) / kMany, 40, 0.5);
}

TEST(Trace, DelaysOfOneNetworkAreOfItsUplink) {
  const DelayLaw law = per_nic_law();
  std::array<std::uint32_t, kModules> modules{};
  std::uint32_t injected = 0;
  for (const Injected& r : make_trace(law, 2, kMany).rounds) {
    if (!r.any) continue;
    ++injected;
    ++modules[static_cast<std::size_t>(r.module)];
    EXPECT_EQ(r.link, r.module == Module::kUplink ? std::optional<std::size_t>(0) : std::nullopt);
  }
  EXPECT_NEAR(injected / double{kMany}, law.share, 0.01);
  EXPECT_NEAR(modules[0] / double(injected), 0.94, 0.01);
  EXPECT_NEAR(modules[1] / double(injected), 0.06, 0.01);
}

TEST(Trace, NoneInjectsNothing) {
  const Trace trace = make_trace({.shape = DelayLaw::Shape::kNone}, 3, 1000);
  EXPECT_TRUE(std::ranges::none_of(trace.rounds, &Injected::any));
  EXPECT_EQ(trace.compute_noise.size(), 1000U);
}

TEST(Trace, IsTheSameForTheSameSeedAndLongerTracesBeginAlike) {
  const Trace a = make_trace({}, 4, 100);
  const Trace b = make_trace({}, 4, 300);
  EXPECT_TRUE(std::ranges::equal(a.rounds, std::span(b.rounds).first(100)));
  EXPECT_TRUE(std::ranges::equal(a.compute_noise, std::span(b.compute_noise).first(100)));
  EXPECT_FALSE(a.rounds == make_trace({}, 5, 100).rounds);
}

TEST(Trace, NoiseHasItsMedianAtTheMedian) {
  std::vector<double> noise = make_trace({}, 6, kMany).compute_noise;
  std::ranges::nth_element(noise, noise.begin() + kMany / 2);
  EXPECT_NEAR(noise[kMany / 2], 0, 0.02);
}

}  // namespace
}  // namespace interneuron::eval::trace_test
