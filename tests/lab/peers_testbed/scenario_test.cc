// Peers, scenarios, and the runs that follow from a choice.
#include "lab/peers_testbed/scenario.h"

#include <gtest/gtest.h>

#include "lab/peers_testbed/comparison.h"

namespace interneuron::peers_testbed::scenario_test {
namespace {

using namespace std::chrono_literals;

TEST(Scenarios, NamesAreThoseOfOneThingEach) {
  for (const Scenario& s : all_scenarios()) EXPECT_EQ(scenario_of(s.name), &s);
  for (const Peer& p : all_peers()) EXPECT_EQ(peer_of(p.name), &p);
  EXPECT_EQ(scenario_of("nowhere"), nullptr);
  EXPECT_EQ(peer_of("nobody"), nullptr);
}

TEST(Scenarios, EachLinkHasARateAndAQueueBothWays) {
  for (const Scenario& s : all_scenarios()) {
    for (const emu::LinkProfile& link : s.links()) {
      for (const emu::DirectionParams* direction : {&link.up, &link.down}) {
        EXPECT_TRUE(direction->trace || direction->rate > DataRate::mbit(1)) << s.name;
        EXPECT_GT(direction->queue_bytes, 0U) << s.name;
      }
    }
  }
}

TEST(Scenarios, TheyDifferByWhatTheirNamesSay) {
  const auto clean = scenario_of("clean")->links();
  EXPECT_EQ(clean[0].up.rate, DataRate::mbit(60));
  EXPECT_EQ(clean[1].up.rate, DataRate::mbit(20));
  EXPECT_EQ(clean[0].delay.min_ms, 30);
  EXPECT_EQ(clean[1].delay.max_ms, 60);
  // 300 ms.
  EXPECT_EQ(clean[1].down.queue_bytes, 750'000U);
  EXPECT_FALSE(clean[0].up.loss);
  EXPECT_EQ(scenario_of("loss")->links()[1].down.loss, 0.01);
  const emu::GilbertElliott chain = *scenario_of("bursts")->links()[0].up.gilbert_elliott;
  EXPECT_NEAR(chain.p / (chain.p + chain.r), 0.01, 1e-12);
  EXPECT_EQ(1 / chain.r, 8);
  EXPECT_EQ(scenario_of("hole")->hole, 5s);
  EXPECT_EQ(scenario_of("loss")->hole, 0s);
  // The delays of a drive, the rates of the bench.
  const auto town = scenario_of("drive-lte-town")->links();
  EXPECT_TRUE(town[0].delay.trace);
  EXPECT_EQ(town[0].up.rate, DataRate::mbit(60));
  EXPECT_TRUE(scenario_of("drive-rates")->links()[1].up.trace);
}

TEST(Scenarios, MessagesComeAsOftenAsTheSlowerLinkCanCarryThem) {
  EXPECT_EQ(period_of(5'000), 100ms);
  EXPECT_EQ(period_of(128 * 1024), 100ms);
  EXPECT_EQ(period_of(1'000'000), 500ms);
  EXPECT_EQ(period_of(8 * 1024 * 1024), 5s);
}

TEST(Scenarios, ASmallerVariantIsForThoseThatKnowIt) {
  EXPECT_EQ(variant_bytes(*peer_of("mptcp"), 1000), std::vector<std::size_t>{1000});
  EXPECT_EQ(variant_bytes(*peer_of("ours_down_sampling"), 1000),
            (std::vector<std::size_t>{1000, 250}));
}

TEST(Scenarios, APeerThatHeedsDeadlinesHasARunForEach) {
  Choice choice;
  choice.scenarios = {scenario_of("hole")};
  choice.sizes = {5'000};
  choice.peers = {peer_of("udp"), peer_of("mptcp")};
  choice.messages = 20;
  choice.seed = 3;
  const auto runs = runs_of(choice);
  ASSERT_EQ(runs.size(), 4U);
  EXPECT_EQ(runs[0].peer, peer_of("udp"));
  EXPECT_EQ(runs[0].deadlines, (std::vector<Duration>{100ms, 150ms, 300ms}));
  EXPECT_EQ(runs[0].length(), 2s);
  EXPECT_EQ(runs[0].seed, 3U);
  EXPECT_GT(time_of_run(runs[0]), 2300ms);
  EXPECT_EQ(runs[1].deadlines, std::vector<Duration>{100ms});
  EXPECT_EQ(runs[3].deadlines, std::vector<Duration>{300ms});
  EXPECT_EQ(transport_of(runs[3]), (transports::Transport{transports::Kind::kMptcp, "cubic"}));
}

TEST(Scenarios, ALengthStandsForAsManyMessagesAsItHolds) {
  Choice choice;
  choice.scenarios = {scenario_of("clean")};
  choice.peers = {peer_of("udp")};
  choice.messages = 20;
  choice.length = 3s;
  const auto runs = runs_of(choice);
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_EQ(runs[0].messages, 30U);
  EXPECT_EQ(runs[1].messages, 30U);
  // One every 500 ms.
  EXPECT_EQ(runs[2].messages, 6U);
  choice.length = 1ms;
  EXPECT_EQ(runs_of(choice)[0].messages, 1U);
}

TEST(Scenarios, WithoutAChoiceEverythingIsRun) {
  std::size_t of_a_scenario = 0;
  for (const Peer& p : all_peers()) of_a_scenario += p.heeds_deadline ? kDeadlines.size() : 1;
  EXPECT_EQ(runs_of({}).size(), all_scenarios().size() * kSizes.size() * of_a_scenario);
}

}  // namespace
}  // namespace interneuron::peers_testbed::scenario_test
