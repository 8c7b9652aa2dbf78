// How predictions are judged.
#include "lab/load/forecast.h"

#include <gtest/gtest.h>

#include <cmath>

namespace interneuron::load::calibration_test {
namespace {

// So many messages of one prediction, of which this share was on time: evenly spread over seconds
// of ten messages, or whole seconds alike.
std::vector<Forecast> messages(double predicted, double share, std::size_t count, bool alike) {
  std::vector<Forecast> out;
  const auto per = static_cast<std::size_t>(std::lround(share * 10));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = alike ? i / 10 % 10 : i % 10;
    out.push_back({predicted, place < per, false, i / 10});
  }
  return out;
}

void append(std::vector<Forecast>& to, const std::vector<Forecast>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

TEST(Calibration, WhatHappensAsPredictedIsKept) {
  const auto bins = calibration(messages(0.7, 0.7, 3000, false));
  ASSERT_EQ(bins.size(), 1U);
  EXPECT_NEAR(bins[0].gap(), 0, 1e-9);
  EXPECT_EQ(bins[0].messages, 3000U);
  EXPECT_TRUE(bins[0].kept());
}

TEST(Calibration, TenPointsAreNotKept) {
  const auto bins = calibration(messages(0.8, 0.7, 3000, false));
  ASSERT_EQ(bins.size(), 1U);
  EXPECT_NEAR(bins[0].gap(), -0.1, 1e-9);
  EXPECT_FALSE(bins[0].kept());
}

// 300 seconds that each are all on time or not at all: sqrt(0.7 * 0.3 / 300).
TEST(Calibration, MessagesOfOneSecondCountAsOne) {
  const auto bins = calibration(messages(0.7, 0.7, 3000, true));
  ASSERT_EQ(bins.size(), 1U);
  EXPECT_NEAR(bins[0].standard_error, std::sqrt(0.7 * 0.3 / 300), 0.001);
}

TEST(Calibration, BinsThatAreTooSmallAreJoined) {
  std::vector<Forecast> all = messages(0.15, 0.1, 2600, false);
  append(all, messages(0.55, 0.5, 1000, false));
  append(all, messages(0.65, 0.6, 1600, false));
  append(all, messages(0.85, 0.8, 100, false));
  const auto bins = calibration(all);
  ASSERT_EQ(bins.size(), 2U);
  EXPECT_EQ(bins[0].messages, 2600U);
  EXPECT_EQ(bins[1].messages, 2700U);
}

TEST(BrierScore, IsTheMeanSquareOfWhatPredictionsAreOff) {
  EXPECT_EQ(brier_score({}), 0);
  EXPECT_NEAR(brier_score(messages(0.5, 0.7, 1000, false)), 0.25, 1e-9);
  EXPECT_NEAR(brier_score(messages(0.7, 0.7, 1000, false)), 0.7 * 0.3, 1e-9);
}

TEST(Calibration, TooFewMessagesAreOneBin) {
  EXPECT_TRUE(calibration({}).empty());
  const auto bins = calibration(messages(0.5, 0.5, 20, false));
  ASSERT_EQ(bins.size(), 1U);
  EXPECT_EQ(bins[0].messages, 20U);
}

}  // namespace
}  // namespace interneuron::load::calibration_test
