#include "link/nature.h"

#include <gtest/gtest.h>

#include <limits>

namespace interneuron::link {
namespace {

using std::chrono::milliseconds;

LinkState up(Duration rtt_p95, DataRate rate, double loss) {
  LinkState link;
  link.up = true;
  link.rtt_p95 = rtt_p95;
  link.rate = rate;
  link.loss = loss;
  return link;
}

TEST(Nature, ScoresAreRelativeToTheBestLink) {
  std::vector<LinkState> links{up(milliseconds(20), DataRate::mbit(100), 0.001),
                               up(milliseconds(80), DataRate::mbit(30), 0.004),
                               up(milliseconds(40), DataRate::mbit(200), 0.01)};
  score(links);
  EXPECT_EQ(links[0].nature, (Nature{1.0, 0.5, 1.0, 0.0}));
  EXPECT_EQ(links[1].nature, (Nature{0.25, 0.15, 0.25, 0.0}));
  EXPECT_EQ(links[2].nature, (Nature{0.5, 1.0, 0.1, 0.0}));
}

TEST(Nature, ALinkThatIsDownHasNothingAndSetsNoStandard) {
  std::vector<LinkState> links{up(milliseconds(1), DataRate::mbit(1000), 0.0),
                               up(milliseconds(80), DataRate::mbit(30), 0.004)};
  links[0].up = false;
  links[0].nature = {1, 1, 1, 1};
  score(links);
  EXPECT_EQ(links[0].nature, Nature{});
  EXPECT_EQ(links[1].nature, (Nature{1.0, 1.0, 1.0, 0.0}));
}

TEST(Nature, LossBelowTheFloorIsAllTheSame) {
  std::vector<LinkState> links{up(milliseconds(20), {}, 0.0), up(milliseconds(20), {}, kLossFloor),
                               up(milliseconds(20), {}, 2 * kLossFloor),
                               up(milliseconds(20), {}, std::numeric_limits<double>::quiet_NaN())};
  score(links);
  EXPECT_EQ(links[0].nature.reliability, 1.0);
  EXPECT_EQ(links[1].nature.reliability, 1.0);
  EXPECT_EQ(links[2].nature.reliability, 0.5);
  EXPECT_EQ(links[3].nature.reliability, 1.0);
}

TEST(Nature, WhatIsNotMeasuredComesAfterWhatIsAndBeforeWhatIsDown) {
  std::vector<LinkState> links{up({}, {}, 0.0), up(milliseconds(20), DataRate::mbit(100), 0.001),
                               up(milliseconds(80), DataRate::mbit(25), 0.01)};
  score(links);
  EXPECT_EQ(links[2].nature, (Nature{0.25, 0.25, 0.1, 0.0}));
  EXPECT_EQ(links[0].nature, (Nature{0.125, 0.125, 0.05, 0.0}));
}

TEST(Nature, WithoutAnyMeasurementAllAreEqual) {
  std::vector<LinkState> links{up({}, {}, 0.0), up({}, {}, 0.0), {}};
  score(links);
  EXPECT_EQ(links[0].nature, (Nature{1.0, 1.0, 1.0, 0.0}));
  EXPECT_EQ(links[1].nature, (Nature{1.0, 1.0, 1.0, 0.0}));
  EXPECT_EQ(links[2].nature, Nature{});
  score({});
}

TEST(Nature, ScalingAQuantityOnAllLinksChangesNothing) {
  std::vector<LinkState> links{up(Duration(12'345'679), DataRate{98'765'431}, 0.003),
                               up(Duration(7'654'321), DataRate{12'345'677}, 0.0007),
                               up({}, {}, 0.0)};
  score(links);
  std::vector<LinkState> scaled = links;
  for (LinkState& link : scaled) {
    link.rtt_p95 *= 1000;
    link.rate.bits_per_second *= 7;
  }
  score(scaled);
  for (std::size_t i = 0; i < links.size(); ++i) EXPECT_EQ(links[i].nature, scaled[i].nature) << i;
}

}  // namespace
}  // namespace interneuron::link
