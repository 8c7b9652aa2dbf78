// The scenarios offer what they say.
#include "lab/load/scenario.h"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

namespace interneuron::load::scenario_test {
namespace {

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

}  // namespace
}  // namespace interneuron::load::scenario_test
