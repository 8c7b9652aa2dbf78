#include "core/probe/summary.h"

#include <gtest/gtest.h>

namespace interneuron::probe::train_test {
namespace {

std::vector<std::int64_t> spaced(std::size_t count, Duration apart) {
  std::vector<std::int64_t> out;
  for (std::size_t i = 0; i < count; ++i) {
    out.push_back(static_cast<std::int64_t>(i) * apart.count());
  }
  return out;
}

constexpr std::size_t kBytes = 1250;  // 10,000 bits

TEST(ProbeTrain, TheRateIsThatOfThePacketsBehindTheFirstTwo) {
  auto arrivals = spaced(19, std::chrono::milliseconds(1));
  arrivals[0] -= 50'000'000;  // waited for its slot
  const auto rate = dispersion_rate(arrivals, kBytes, 19);
  ASSERT_TRUE(rate);
  EXPECT_NEAR(rate->mbit(), 10, 1e-6);
}

TEST(ProbeTrain, TheOrderOfArrivalDoesNotMatter) {
  auto arrivals = spaced(19, std::chrono::milliseconds(1));
  std::swap(arrivals[3], arrivals[17]);
  EXPECT_NEAR(dispersion_rate(arrivals, kBytes, 19)->mbit(), 10, 1e-6);
}

TEST(ProbeTrain, TooFewOrTooQuickSayNothing) {
  EXPECT_FALSE(dispersion_rate(spaced(15, std::chrono::milliseconds(1)), kBytes, 19));
  EXPECT_FALSE(dispersion_rate(spaced(19, std::chrono::microseconds(200)), kBytes, 19));
  EXPECT_FALSE(dispersion_rate({}, kBytes, 19));
  EXPECT_FALSE(dispersion_rate(spaced(1, std::chrono::seconds(1)), kBytes, 1));
  EXPECT_FALSE(dispersion_rate(spaced(256, Duration{0}), kBytes, 256));
  EXPECT_TRUE(dispersion_rate(spaced(256, std::chrono::microseconds(10)), kBytes, 256));
}

TEST(ProbeTrain, ItsLengthFollowsTheRate) {
  EXPECT_EQ(train_length({}, kBytes), 19U);
  EXPECT_EQ(train_length(DataRate::mbit(10), kBytes), 19U);
  EXPECT_EQ(train_length(DataRate::mbit(100), kBytes), 83U);  // 8 ms of 100 packets a 10 ms, and 3
  EXPECT_EQ(train_length(DataRate::mbit(10'000), kBytes), kTrainMaxPackets);
}

TEST(ProbeTrain, TheMedianIsTheLowerMiddle) {
  EXPECT_FALSE(median({}));
  EXPECT_EQ(median({DataRate{3}}), DataRate{3});
  EXPECT_EQ(median({DataRate{9}, DataRate{1}, DataRate{3}, DataRate{5}}), DataRate{3});
}

}  // namespace
}  // namespace interneuron::probe::train_test
