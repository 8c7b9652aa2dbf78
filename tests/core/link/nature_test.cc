#include "core/link/nature.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <limits>

namespace interneuron::link::nature_test {
namespace {

using std::chrono::milliseconds;

LinkState up(Duration rtt_p95, DataRate rate, double loss) {
  return LinkState{.up = true, .rtt_p95 = rtt_p95, .rate = rate, .loss = loss};
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

TEST(Nature, TheQueueUpAddsToTheDelay) {
  std::vector<LinkState> links{up(milliseconds(40), {}, 0.0), up(milliseconds(40), {}, 0.0)};
  links[1].queue_up = milliseconds(20);
  links[1].queue_down = milliseconds(500);  // in the round trip already
  score(links);
  EXPECT_EQ(links[0].nature.delay, 1.0);
  EXPECT_EQ(links[1].nature.delay, 0.5);
}

TEST(Nature, OutageWeighsOnReliability) {
  std::vector<LinkState> links{up(milliseconds(40), {}, 0.01), up(milliseconds(40), {}, 0.01)};
  links[1].outage = 0.2;
  score(links);
  EXPECT_EQ(links[0].nature.reliability, 1.0);
  EXPECT_DOUBLE_EQ(links[1].nature.reliability, 0.8);
}

TEST(Nature, SecurityIsWhatTheOperatorSays) {
  std::vector<LinkState> links{up(milliseconds(40), {}, 0), up(milliseconds(40), {}, 0), {}};
  links[1].traits.trusted = links[2].traits.trusted = true;
  score(links);
  EXPECT_EQ(links[0].nature.security, 0.0);
  EXPECT_EQ(links[1].nature.security, 0.5);
  EXPECT_EQ(links[2].nature.security, 0.0) << "it is down";
}

TEST(Nature, ConfidenceHalvesWithAge) {
  EXPECT_EQ(confidence({}, kGrace, kHalfLife), 1.0);
  EXPECT_EQ(confidence(kGrace, kGrace, kHalfLife), 1.0);
  EXPECT_DOUBLE_EQ(confidence(kGrace + kHalfLife, kGrace, kHalfLife), 0.5);
  EXPECT_DOUBLE_EQ(confidence(kGrace + 3 * kHalfLife, kGrace, kHalfLife), 0.125);
  EXPECT_EQ(confidence(Duration::max(), kGrace, kHalfLife), 0.0);
}

TEST(Nature, OldEvidenceCountsAsWorse) {
  std::vector<LinkState> links{up(milliseconds(40), DataRate::mbit(10), 0.01),
                               up(milliseconds(40), DataRate::mbit(10), 0.01)};
  links[0].age = kGrace + kHalfLife;
  score(links);
  EXPECT_DOUBLE_EQ(links[0].nature.delay, 0.75);
  EXPECT_DOUBLE_EQ(links[0].nature.reliability, 0.75);
  EXPECT_EQ(links[0].nature.bandwidth, 1.0) << "the rate has an age of its own";
  EXPECT_EQ(links[1].nature, (Nature{1.0, 1.0, 1.0, 0.0}));
  links[0].rate_age = kRateGrace + 40 * kRateHalfLife;
  score(links);
  EXPECT_NEAR(links[0].nature.bandwidth, 0.5, 1e-9);
}

TEST(Nature, EvidenceExplainsTheScore) {
  std::vector<LinkState> links{up(milliseconds(20), DataRate::mbit(100), 0.001),
                               up(milliseconds(80), DataRate::mbit(30), 0.004), up({}, {}, 0)};
  links[1].traits.trusted = true;
  score(links);
  const Evidence e = explain(links[1], links);
  EXPECT_DOUBLE_EQ(e.delay.value, 0.040);
  EXPECT_DOUBLE_EQ(e.delay.best, 0.010);
  EXPECT_DOUBLE_EQ(e.delay.best / e.delay.value, links[1].nature.delay);
  EXPECT_DOUBLE_EQ(e.bandwidth.value / e.bandwidth.best, links[1].nature.bandwidth);
  EXPECT_DOUBLE_EQ(e.reliability.best / e.reliability.value, links[1].nature.reliability);
  EXPECT_TRUE(e.trusted);
  EXPECT_FALSE(e.encrypted);
  EXPECT_FALSE(explain(links[2], links).delay.measured);
}

LinkState any_link() {
  LinkState link = up(Duration{*rc::gen::inRange<std::int64_t>(0, 2'000'000'000)},
                      DataRate{*rc::gen::inRange<std::int64_t>(0, 1'000'000'000)},
                      *rc::gen::inRange(0, 1001) / 1000.0);
  link.up = *rc::gen::inRange(0, 5) != 0;
  link.queue_up = Duration{*rc::gen::inRange<std::int64_t>(0, 500'000'000)};
  link.outage = *rc::gen::inRange(0, 1001) / 1000.0;
  link.age = Duration{*rc::gen::inRange<std::int64_t>(0, 20'000'000'000)};
  link.rate_age = Duration{*rc::gen::inRange<std::int64_t>(0, 200'000'000'000)};
  return link;
}

TEST(NatureProperty, ScoresAreRatiosTheBestHasOne) {
  EXPECT_TRUE(rc::check([] {
    std::vector<LinkState> links(*rc::gen::inRange<std::size_t>(1, 9));
    for (LinkState& link : links) link = any_link();
    score(links);
    for (double Nature::*field : {&Nature::delay, &Nature::bandwidth, &Nature::reliability}) {
      double best = 0;
      bool any_up = false;
      for (const LinkState& link : links) {
        const double s = link.nature.*field;
        RC_ASSERT(s >= 0.0 && s <= 1.0);
        RC_ASSERT((link.up ? s > 0.0 : s == 0.0));
        best = std::max(best, s);
        any_up |= link.up;
      }
      const double expected = any_up ? 1.0 : 0.0;
      RC_ASSERT(best == expected);
    }
    std::vector<LinkState> scaled = links;
    for (LinkState& link : scaled) {
      link.rtt_p95 *= 1024;
      link.queue_up *= 1024;
      link.rate.bits_per_second *= 1024;
    }
    score(scaled);
    for (std::size_t i = 0; i < links.size(); ++i) {
      RC_ASSERT(std::abs(scaled[i].nature.delay - links[i].nature.delay) < 1e-12);
      RC_ASSERT(std::abs(scaled[i].nature.bandwidth - links[i].nature.bandwidth) < 1e-12);
      RC_ASSERT(scaled[i].nature.reliability == links[i].nature.reliability);
    }
  }));
}

}  // namespace
}  // namespace interneuron::link::nature_test
