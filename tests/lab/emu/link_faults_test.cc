// What a link does to packets beside delaying them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>

#include "support.h"

namespace interneuron::emu::link_faults_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kMany = 50'000;

LinkModel link_with(void (*set)(DirectionParams&), std::uint64_t seed = 1) {
  DirectionParams params = rate_of_mbit(1000);
  set(params);
  return constant_link(params, 20, 0, seed);
}

double share(std::uint64_t part, std::uint64_t all) {
  return static_cast<double>(part) / static_cast<double>(all);
}

TEST(LinkFaults, BernoulliLossIsWithinThreeTenthsOfAPoint) {
  for (const double loss : {0.01, 0.05}) {
    LinkModel link = constant_link(rate_of_mbit(1000), 20, loss);
    stream(link, kMany, milliseconds(1));
    EXPECT_NEAR(share(link.stats().lost, kMany), loss, 0.003);
  }
}

TEST(LinkFaults, LossOfADirectionReplacesThatOfTheState) {
  LinkModel link = constant_link(
      [] {
        DirectionParams params = rate_of_mbit(1000);
        params.loss = 0.2;
        return params;
      }(),
      20, 0.9);
  stream(link, kMany, milliseconds(1));
  EXPECT_NEAR(share(link.stats().lost, kMany), 0.2, 0.01);
}

TEST(LinkFaults, BurstsHaveTheirMeanLength) {
  LinkModel link = link_with([](DirectionParams& p) {
    p.gilbert_elliott = GilbertElliott{0.01, 0.2};
  });
  int bursts = 0;
  int lost = 0;
  bool in_burst = false;
  constexpr int kPackets = 400'000;
  for (int i = 0; i < kPackets; ++i) {
    const bool through = link.enqueue(microseconds(100) * i, 100, 0);
    drain(link);
    lost += through ? 0 : 1;
    bursts += !through && !in_burst ? 1 : 0;
    in_burst = !through;
  }
  ASSERT_GT(bursts, 1000);
  EXPECT_NEAR(static_cast<double>(lost) / bursts, 5, 0.5);                // 1/r
  EXPECT_NEAR(static_cast<double>(lost) / kPackets, 0.01 / 0.21, 0.005);  // p / (p + r)
}

TEST(LinkFaults, BurstsMayLosePartially) {
  LinkModel link = link_with([](DirectionParams& p) {
    p.gilbert_elliott = GilbertElliott{0.1, 0.1, 0.02, 0.5};
  });
  stream(link, 4 * kMany, milliseconds(1));
  EXPECT_NEAR(share(link.stats().lost, 4 * kMany), 0.26, 0.01);  // half the time in each state
}

TEST(LinkFaults, DuplicatesComeAsTwoOfOneTag) {
  LinkModel link = link_with([](DirectionParams& p) { p.duplicate = 0.1; });
  std::uint64_t copies = 0;
  for (std::uint64_t i = 0; i < kMany; ++i) {
    ASSERT_TRUE(link.enqueue(milliseconds(i), 100, i));
    const auto out = drain(link);
    ASSERT_TRUE(out.size() == 1 || out.size() == 2);
    EXPECT_TRUE(out.back().last);
    if (out.size() == 1) continue;
    ++copies;
    EXPECT_FALSE(out[0].last);
    EXPECT_EQ(out[0].tag, out[1].tag);
    EXPECT_EQ(out[0].due, out[1].due);
  }
  EXPECT_EQ(link.stats().duplicated, copies);
  EXPECT_EQ(link.stats().delivered, kMany + copies);
  EXPECT_NEAR(share(copies, kMany), 0.1, 0.01);
}

TEST(LinkFaults, CorruptOnesAreMarkedAndCounted) {
  LinkModel link = link_with([](DirectionParams& p) { p.corrupt = 0.05; });
  std::uint64_t corrupt = 0;
  for (int i = 0; i < kMany; ++i) {
    ASSERT_TRUE(link.enqueue(milliseconds(i), 100, 0));
    corrupt += drain(link).front().corrupt ? 1U : 0U;
  }
  EXPECT_EQ(link.stats().corrupted, corrupt);
  EXPECT_NEAR(share(corrupt, kMany), 0.05, 0.005);
}

TEST(LinkFaults, ReorderedOnesArriveEarlier) {
  LinkModel link = link_with([](DirectionParams& p) {
    p.reorder = 0.25;
    p.reorder_by = milliseconds(4);
  });
  std::vector<LinkModel::Packet> out;
  for (std::uint64_t i = 0; i < kMany; ++i) {
    const Duration now = milliseconds(i);
    ASSERT_TRUE(link.enqueue(now, 125, i));
    for (const auto& packet : drain(link, now)) out.push_back(packet);
  }
  for (const auto& packet : drain(link)) out.push_back(packet);
  ASSERT_EQ(out.size(), static_cast<std::size_t>(kMany));
  std::uint64_t early = 0;
  Duration last{};
  for (const LinkModel::Packet& packet : out) {
    EXPECT_GE(packet.due, last);
    last = packet.due;
    const Duration delay = packet.due - milliseconds(packet.tag) - microseconds(1);
    ASSERT_TRUE(delay == milliseconds(10) || delay == milliseconds(6)) << delay.count();
    if (delay == milliseconds(6)) ++early;
  }
  EXPECT_EQ(link.stats().reordered, early);
  EXPECT_NEAR(share(early, kMany), 0.25, 0.01);
  EXPECT_FALSE(std::is_sorted(out.begin(), out.end(),
                              [](const auto& a, const auto& b) { return a.tag < b.tag; }));
}

TEST(LinkFaults, ReorderingByDefaultSkipsTheWholeDelayAsNetem) {
  LinkModel link = link_with([](DirectionParams& p) { p.reorder = 1; });
  ASSERT_TRUE(link.enqueue(seconds(1), 125, 0));
  EXPECT_EQ(link.next_delivery(), seconds(1) + microseconds(1));  // has left the bottleneck
}

TEST(LinkFaults, PacketsAboveTheMtuVanish) {
  LinkModel link = link_with([](DirectionParams& p) { p.mtu = 1400; });
  EXPECT_TRUE(link.enqueue({}, 1400, 0));
  EXPECT_FALSE(link.enqueue({}, 1401, 0));
  EXPECT_EQ(link.stats().too_big, 1U);
}

TEST(LinkFaults, OneFeatureDoesNotChangeWhatAnotherDraws) {
  const auto corrupt_tags = [](void (*set)(DirectionParams&)) {
    LinkModel link = link_with(set, 9);
    std::set<std::uint64_t> out;
    for (std::uint64_t i = 0; i < 5000; ++i) {
      link.enqueue(milliseconds(i), 100, i);
      for (const auto& packet : drain(link)) {
        if (packet.corrupt) out.insert(packet.tag);
      }
    }
    return out;
  };
  const auto alone = corrupt_tags([](DirectionParams& p) { p.corrupt = 0.1; });
  const auto with_all = corrupt_tags([](DirectionParams& p) {
    p.corrupt = 0.1;
    p.duplicate = 0.3;
    p.reorder = 0.3;
    p.loss = 0.3;
    p.gilbert_elliott = GilbertElliott{0.1, 0.5};
  });
  // Those that were not lost are corrupt or not as without the other features.
  EXPECT_TRUE(std::includes(alone.begin(), alone.end(), with_all.begin(), with_all.end()));
  EXPECT_GT(with_all.size(), alone.size() / 3);
  EXPECT_LT(with_all.size(), alone.size());
}

TEST(LinkFaults, PeriodicOutagesLoseWhatLeavesTheBottleneckInThem) {
  LinkProfile profile = constant_profile(20);
  profile.outages = {seconds(10), seconds(2), seconds(30)};
  Link link(profile, 1);
  for (int ms = 0; ms < 60'000; ms += 10) {
    const Duration t = milliseconds(ms) % seconds(30);
    const bool out = t >= seconds(10) && t < seconds(12);
    ASSERT_EQ(link.up().enqueue(milliseconds(ms), 100, 0), !out) << ms;
  }
  EXPECT_EQ(link.up().stats().outage_lost, 400U);
  EXPECT_EQ(link.up().stats().lost, 0U);
}

TEST(LinkFaults, MeasuredUnavailabilityIsAnOutage) {
  LinkProfile profile = profile_of("lte-sprint-highway");
  profile.up.loss = 0;
  Link link(profile, 1);
  const std::vector<double>& rtt_ms = profile.delay.trace->rtt_ms;
  for (std::size_t i = 0; i + 1 < rtt_ms.size(); ++i) {
    const Duration now = seconds(i) + milliseconds(500);
    ASSERT_EQ(link.up().enqueue(now, 100, 0), rtt_ms[i] >= 0) << i;
    drain(link.up());
  }
  EXPECT_EQ(link.up().stats().outage_lost, 86U);
}

TEST(LinkFaults, APolicerLetsItsRateAndABurstPass) {
  LinkModel link = link_with([](DirectionParams& p) { p.police = {DataRate::mbit(10), 50'000}; });
  // 20 Mbit/s for 10 s: 50 kB at once and 12.5 MB after that, of 25 MB.
  stream(link, 25'000, microseconds(400), 1000);
  EXPECT_NEAR(static_cast<double>(link.stats().delivered), 12'550, 2);
  EXPECT_EQ(link.stats().delivered + link.stats().policed, 25'000U);
}

TEST(LinkFaults, APolicerDropsNothingBelowItsRate) {
  LinkModel link = link_with([](DirectionParams& p) { p.police = {DataRate::mbit(10), 50'000}; });
  stream(link, 10'000, microseconds(810), 1000);
  EXPECT_EQ(link.stats().policed, 0U);
}

TEST(LinkFaults, APolicerThatIsSetAnewIsFull) {
  Link link(constant_profile(20), 1);
  LinkChange change;
  change.direction(Direction::kUp).police_rate = DataRate::mbit(1);
  change.direction(Direction::kUp).police_bytes = 3000;
  link.change(seconds(1), change);
  int passed = 0;
  for (int i = 0; i < 10; ++i) passed += link.up().enqueue(seconds(2), 1000, 0) ? 1 : 0;
  EXPECT_EQ(passed, 3);
  change.direction(Direction::kUp).police_rate = DataRate{};
  link.change(seconds(2), change);
  EXPECT_TRUE(link.up().enqueue(seconds(2), 1000, 0));
}

TEST(LinkFaults, AShaperLetsABurstPassAndThenItsRate) {
  LinkModel link = link_with([](DirectionParams& p) { p.shape = {DataRate::mbit(10), 50'000}; });
  for (std::uint64_t i = 0; i < 100; ++i) ASSERT_TRUE(link.enqueue({}, 1000, i));
  const std::vector<LinkModel::Packet> out = drain(link);
  ASSERT_EQ(out.size(), 100U);
  // 10 ms of delay, 8 us each on the bottleneck, and 800 us each beyond the first 50.
  EXPECT_EQ(out[0].due, milliseconds(10) + microseconds(8));
  EXPECT_LE(out[49].due, milliseconds(10) + microseconds(400));
  EXPECT_EQ(out[99].due, milliseconds(10) + microseconds(8) + microseconds(50 * 800));
  EXPECT_EQ(link.stats().queue_drops, 0U);
}

TEST(LinkFaults, AShaperThatBecomesSlowerHoldsUpWhatWaits) {
  LinkModel link = link_with([](DirectionParams& p) { p.shape = {DataRate::mbit(10), 2000}; });
  for (std::uint64_t i = 0; i < 12; ++i) ASSERT_TRUE(link.enqueue({}, 1000, i));
  DirectionParams slower = link.params();
  slower.shape.rate = DataRate::mbit(1);
  link.change(milliseconds(1), slower);
  const std::vector<LinkModel::Packet> out = drain(link);
  ASSERT_EQ(out.size(), 12U);
  // The fourth was on its way; eight behind it take 8 ms each.
  EXPECT_NEAR(to_ms(out[11].due), 10 + 1.6 + 8 * 8, 1);
}

TEST(LinkFaults, GrantsBundlePacketsAndKeepTheRate) {
  LinkModel link = link_with([](DirectionParams& p) {
    p.rate = DataRate::mbit(8);
    p.grant_every = milliseconds(10);
  });
  // 8 Mbit/s is 1000 bytes a millisecond, and 10,000 in a grant, which no number of packets fills.
  for (std::uint64_t i = 0; i < 900; ++i) ASSERT_TRUE(link.enqueue({}, 1013, i));
  const std::vector<LinkModel::Packet> out = drain(link);
  ASSERT_EQ(out.size(), 900U);
  for (const LinkModel::Packet& packet : out) {
    ASSERT_LE((packet.due - milliseconds(10)) % milliseconds(10), milliseconds(2));
  }
  // 91 grants, and 1,700 bytes at 5 bytes a microsecond.
  EXPECT_NEAR(to_ms(out.back().due), 10 + 910 + 0.34, 0.01);
}

TEST(LinkFaults, WhatTheRadioSendsAgainHoldsUpTheRest) {
  LinkModel link = link_with([](DirectionParams& p) { p.harq = 0.1; });
  std::array<int, 5> late{};
  for (int i = 0; i < kMany; ++i) {
    ASSERT_TRUE(link.enqueue(milliseconds(100) * i, 1000, 0));
    const std::vector<LinkModel::Packet> out = drain(link);
    ASSERT_EQ(out.size(), 1U);
    const Duration beyond = out[0].due - milliseconds(100) * i - milliseconds(10);
    ++late.at(static_cast<std::size_t>(beyond / milliseconds(8)));
  }
  EXPECT_NEAR(share(static_cast<std::uint64_t>(late[1] + late[2] + late[3]), kMany), 0.1, 0.005);
  EXPECT_NEAR(share(static_cast<std::uint64_t>(late[2] + late[3]), kMany), 0.01, 0.002);
  EXPECT_EQ(late[4], 0);
}

TEST(LinkFaults, ASleepingRadioWakesUpForBothDirections) {
  LinkProfile profile = constant_profile(20);
  profile.up.wake_by = profile.down.wake_by = milliseconds(200);
  Link link(profile, 1);
  const auto delay = [](LinkModel& model, Duration at) {
    EXPECT_TRUE(model.enqueue(at, 100, 0));
    const std::vector<LinkModel::Packet> out = drain(model);
    return out.empty() ? Duration{} : out.back().due - at;
  };
  EXPECT_NEAR(to_ms(delay(link.up(), {})), 210, 0.1);
  // What comes down while it wakes up waits for the rest of that.
  EXPECT_NEAR(to_ms(delay(link.down(), milliseconds(150))), 60, 0.1);
  EXPECT_NEAR(to_ms(delay(link.up(), milliseconds(300))), 10, 0.1);
  EXPECT_NEAR(to_ms(delay(link.down(), seconds(10))), 10, 0.1);
  EXPECT_NEAR(to_ms(delay(link.up(), seconds(20))), 10, 0.1);
  EXPECT_NEAR(to_ms(delay(link.up(), seconds(31))), 210, 0.1);
}

class CarrierNat : public testing::Test {
 protected:
  CarrierNat() : link(profile_of("carrier-nat"), 1) {}
  Link link;
};

TEST_F(CarrierNat, DropsTinyPackets) {
  EXPECT_FALSE(link.up().enqueue({}, 59, 0));
  EXPECT_TRUE(link.up().enqueue({}, 60, 0));
  EXPECT_EQ(link.up().stats().nat_drops, 1U);
}

TEST_F(CarrierNat, ReordersLargePacketsOnly) {
  for (int i = 0; i < kMany; ++i) {
    const Duration now = milliseconds(i);
    ASSERT_TRUE(link.up().enqueue(now, i % 2 == 0 ? 1441 : 1440, 0));
    drain(link.up(), now);
  }
  EXPECT_NEAR(share(link.up().stats().reordered, kMany / 2), 0.03, 0.003);
}

TEST_F(CarrierNat, ForgetsAnIdleMapping) {
  EXPECT_FALSE(link.down().enqueue(milliseconds(1), 100, 0));  // nothing has gone up yet
  EXPECT_TRUE(link.up().enqueue(seconds(1), 100, 0));
  EXPECT_TRUE(link.down().enqueue(seconds(16), 100, 0));
  EXPECT_FALSE(link.down().enqueue(seconds(16) + milliseconds(1), 100, 0));
  EXPECT_TRUE(link.up().enqueue(seconds(17), 100, 0));
  EXPECT_TRUE(link.down().enqueue(seconds(18), 100, 0));
  EXPECT_EQ(link.down().stats().nat_drops, 2U);
}

}  // namespace
}  // namespace interneuron::emu::link_faults_test
