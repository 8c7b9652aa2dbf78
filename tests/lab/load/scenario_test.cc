// The scenarios offer what they say.
#include "lab/load/scenario.h"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

namespace interneuron::load::scenario_test {
namespace {

using namespace std::chrono_literals;

TEST(Scenario, EveryGroupOffersTheLoadItNames) {
  for (const Group& group : groups()) {
    const auto all = scenarios(group.name, {});
    EXPECT_FALSE(all.empty()) << group.name;
    for (const Scenario& s : all) {
      const double offered =
          static_cast<double>(s.vehicles * ip_bytes_of(s.message_bytes)) * 8 / to_seconds(s.period);
      const double capacity = static_cast<double>(s.capacity.bits_per_second);
      EXPECT_NEAR(offered / capacity, s.load, 0.005) << group.name << " " << s.name;
      const bool has_variants = s.peer == Peer::kOursVariants;
      EXPECT_EQ(s.small_bytes > 0, has_variants) << group.name << " " << s.name;
      EXPECT_LT(s.small_bytes, s.message_bytes) << group.name << " " << s.name;
    }
  }
}

TEST(Scenario, WhatIsChosenIsRunAndNothingElse) {
  Choice choice{.peers = {Peer::kOurs}, .loads = {1.05, 2.5}};
  for (const Scenario& s : scenarios("rate", choice)) {
    EXPECT_EQ(s.peer, Peer::kOurs);
    EXPECT_TRUE(s.load == 1.05 || s.load == 2.5) << s.load;
  }
  EXPECT_TRUE(scenarios("nothing", choice).empty());
}

TEST(Scenario, NoRunIsMadeTwice) {
  std::set<std::tuple<std::string, std::string, Peer, double>> seen;
  for (const Group& group : groups()) {
    for (const Scenario& s : scenarios(group.name, {})) {
      EXPECT_TRUE(seen.insert({s.group, s.name, s.peer, s.load}).second)
          << s.group << " " << s.name << " " << name_of(s.peer) << " " << s.load;
    }
  }
}

TEST(Scenario, PeersAreFoundByTheirNames) {
  for (const std::string_view name : peer_names()) EXPECT_EQ(name_of(*peer_of(name)), name);
  EXPECT_FALSE(peer_of("quic"));
}

// The run of 50 vehicles.
Scenario crowd_of_fifty(bool is_spread) {
  const Choice choice{.peers = {Peer::kOurs}, .loads = {2.0}, .is_spread = is_spread};
  return scenarios("vehicles", choice).back();
}

TEST(Scenario, VehiclesJoinOneAfterTheOtherUpToTheMostApart) {
  const std::vector<Duration> joined = joins(crowd_of_fifty(true));
  ASSERT_EQ(joined.size(), 50U);
  EXPECT_EQ(joined.front(), Duration{});
  for (std::size_t v = 1; v < joined.size(); ++v) {
    EXPECT_GT(joined[v], joined[v - 1]);
    EXPECT_LE(joined[v] - joined[v - 1], kMostApart);
  }
  // 49 draws from [0, kMostApart): within four standard deviations of their sum.
  EXPECT_NEAR(to_ms(joined.back()), 49 * 50, 4 * 7 * 100 / 3.46);
}

TEST(Scenario, TogetherAllJoinAtOneInstant) {
  for (const Duration joined : joins(crowd_of_fifty(false))) EXPECT_EQ(joined, Duration{});
}

// The phases within a period are drawn apart from the joins.
TEST(Scenario, JoiningLaterMovesTheFirstMessageByAsMuch) {
  const Scenario spread = crowd_of_fifty(true);
  const std::vector<Duration> joined = joins(spread);
  const std::vector<Duration> apart = first_messages(spread);
  const std::vector<Duration> together = first_messages(crowd_of_fifty(false));
  for (std::size_t v = 0; v < apart.size(); ++v) EXPECT_EQ(apart[v], together[v] + joined[v]);
}

TEST(Scenario, WhereNothingComesAfterTheTimeOfJoiningThereIsNone) {
  Scenario s = crowd_of_fifty(true);
  EXPECT_EQ(joining_time(s), joins(s).back() + kEarly);
  s.length = kEarly;
  EXPECT_EQ(joining_time(s), Duration{});
  EXPECT_EQ(joining_time(crowd_of_fifty(false)), Duration{});
}

}  // namespace
}  // namespace interneuron::load::scenario_test
