#include "core/probe/summary.h"

#include <gtest/gtest.h>

#include "interneuron/time.h"

namespace interneuron::probe::summary_test {
namespace {

using namespace std::chrono_literals;

TEST(ProbeDistribution, IsByNearestRank) {
  std::vector<Duration> samples;
  for (int i = 100; i >= 1; --i) samples.push_back(i * 1ms);
  const Distribution d = distribution_of(samples);
  EXPECT_EQ(d.samples, 100U);
  EXPECT_EQ(d.min, 1ms);
  EXPECT_EQ(d.p50, 50ms);
  EXPECT_EQ(d.p95, 95ms);
  EXPECT_EQ(d.max, 100ms);
  EXPECT_NEAR(d.mean_ns, 50.5e6, 1);
  EXPECT_NEAR(d.stddev_ns, 28.866e6, 1e3);
}

TEST(ProbeDistribution, OfNothingAndOfOne) {
  EXPECT_EQ(distribution_of({}).samples, 0U);
  const Distribution d = distribution_of({7ms});
  EXPECT_EQ(d.p50, 7ms);
  EXPECT_EQ(d.p95, 7ms);
  EXPECT_EQ(d.stddev_ns, 0);
}

// One packet a millisecond; `numbers`: the reflector's, -1: no answer.
PacketLog log_of(const std::vector<int>& numbers) {
  PacketLog log;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    SentPacket p{.sent = TimePoint{i * 1ms}, .answered = numbers[i] >= 0};
    p.received = p.sent + 10ms;
    p.counted = static_cast<std::uint32_t>(std::max(numbers[i], 0));
    log.push_back(p);
  }
  return log;
}

using enum Fate;

TEST(ProbeFates, ANumberThatWasNeverSeenIsAReplyThatWasLost) {
  EXPECT_EQ(fates_of(log_of({0, -1, 1, -1, 3}), 1s, true, {}),
            (std::vector<Fate>{kAnswered, kLostUp, kAnswered, kLostDown, kAnswered}));
}

TEST(ProbeFates, BehindTheLastAnswerNothingIsKnown) {
  EXPECT_EQ(fates_of(log_of({0, 1, -1, -1}), 1s, true, {}),
            (std::vector<Fate>{kAnswered, kAnswered, kLost, kLost}));
}

TEST(ProbeFates, BeforeTheFirstAnswerItIsKnown) {
  EXPECT_EQ(fates_of(log_of({-1, -1, 1}), 1s, true, {}),
            (std::vector<Fate>{kLostDown, kLostUp, kAnswered}));
}

TEST(ProbeFates, WithoutCountingItIsJustLost) {
  EXPECT_EQ(fates_of(log_of({0, -1, 2}), 1s, false, {}),
            (std::vector<Fate>{kAnswered, kLost, kAnswered}));
}

TEST(ProbeFates, ADuplicatesNumberIsNoLoss) {
  // The second request came twice: the reflector counted 1 and 2 for it.
  EXPECT_EQ(fates_of(log_of({0, 1, -1, 3}), 1s, true, {2}),
            (std::vector<Fate>{kAnswered, kAnswered, kLostUp, kAnswered}));
}

TEST(ProbeFates, AnyNumberIsHarmless) {
  PacketLog log = log_of({0, -1, 1});
  log[2].counted = UINT32_MAX;
  EXPECT_EQ(fates_of(log, 1s, true, {UINT32_MAX}),
            (std::vector<Fate>{kAnswered, kLostUp, kAnswered}));
}

}  // namespace
}  // namespace interneuron::probe::summary_test
