#include "lab/emu/scenario_player.h"

#include <gtest/gtest.h>

#include "support.h"

namespace interneuron::emu::scenario_player_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

Scenario two_links() {
  return plain_scenario({{"a", constant_profile(20), 1}, {"b", constant_profile(30), 2}}, 5);
}

ScenarioEvent event(Duration at, std::optional<std::size_t> link, const std::string& pair) {
  ScenarioEvent out;
  out.at = at;
  out.link = link;
  if (!pair.empty()) out.change = value_of(parse_change(std::vector<std::string>{pair}));
  return out;
}

TEST(ScenarioPlayer, DoesWhatIsDue) {
  Scenario scenario = two_links();
  scenario.events = {event(seconds(1), 0, "rtt_ms=100"), event(seconds(2), std::nullopt, "loss=1")};
  ScenarioPlayer player(scenario);
  EXPECT_EQ(player.next(), seconds(1));
  player.play(milliseconds(999));
  EXPECT_EQ(player.link(0).conditions(Direction::kUp, {}).one_way, milliseconds(10));
  player.play(milliseconds(1500));
  EXPECT_EQ(player.link(0).conditions(Direction::kUp, {}).one_way, milliseconds(50));
  EXPECT_EQ(player.link(1).conditions(Direction::kUp, {}).one_way, milliseconds(15));
  EXPECT_EQ(player.next(), seconds(2));
  player.play(seconds(2));
  EXPECT_EQ(player.link(0).conditions(Direction::kDown, {}).loss, 1);
  EXPECT_EQ(player.link(1).conditions(Direction::kDown, {}).loss, 1);
  EXPECT_FALSE(player.next());
}

TEST(ScenarioPlayer, WhatIsAtZeroHoldsFromTheBeginning) {
  Scenario scenario = two_links();
  scenario.events = {event({}, std::nullopt, "rtt_ms=100")};
  ScenarioPlayer player(scenario);
  EXPECT_EQ(player.link(1).conditions(Direction::kUp, {}).one_way, milliseconds(50));
}

TEST(ScenarioPlayer, KnowsOutagesAhead) {
  Scenario scenario = two_links();
  scenario.events = {event(seconds(3), 1, "")};
  scenario.events[0].outage = seconds(2);
  ScenarioPlayer player(scenario);
  EXPECT_EQ(player.link(1).conditions(Direction::kUp, seconds(3)).loss, 1);
  EXPECT_EQ(player.link(1).conditions(Direction::kUp, seconds(5)).loss, 0);
  EXPECT_EQ(player.link(0).conditions(Direction::kUp, seconds(3)).loss, 0);
}

TEST(ScenarioPlayer, HolesAreCommonAndExponential) {
  Scenario scenario = two_links();
  scenario.holes = {seconds(20), seconds(2)};
  ScenarioPlayer player(scenario);
  int holes = 0;
  std::int64_t out = 0;
  std::int64_t steps = 0;
  bool before = false;
  for (Duration now{}; now < seconds(40'000); now += milliseconds(20)) {
    if (player.next() <= now) player.play(now);
    const bool first = player.link(0).conditions(Direction::kUp, now).loss > 0;
    const bool second = player.link(1).conditions(Direction::kDown, now).loss > 0;
    ASSERT_EQ(first, second);
    holes += first && !before ? 1 : 0;
    out += first ? 1 : 0;
    ++steps;
    before = first;
  }
  // 1818 expected: s.e. 2.4 % of each.
  EXPECT_NEAR(holes, 40'000 / 22, 40'000 / 22 * 0.08);
  EXPECT_NEAR(static_cast<double>(out) / static_cast<double>(steps), 2.0 / 22, 0.01);
}

TEST(ScenarioPlayer, LinksFadeTogether) {
  Scenario scenario = plain_scenario(
      {{"a", profile_of("4g"), link_seed(1, 0)}, {"b", profile_of("4g"), link_seed(1, 1)}}, 1);
  const auto both_bad = [](Scenario s) {
    ScenarioPlayer player(std::move(s));
    int both = 0;
    for (Duration t{}; t < seconds(kSanitized ? 4000 : 40'000); t += kDelayStep) {
      const auto bad = [&](std::size_t i) {
        return player.link(i).process()->at(t).state == RadioState::kBad;
      };
      both += bad(0) && bad(1) ? 1 : 0;
    }
    return both;
  };
  const int alone = both_bad(scenario);
  scenario.common_fading = 1;
  EXPECT_GT(both_bad(scenario), 2 * alone);
}

TEST(ScenarioPlayer, SameSeedSameDrive) {
  Scenario scenario = two_links();
  scenario.holes = {seconds(5), seconds(1)};
  ScenarioPlayer a(scenario);
  ScenarioPlayer b(scenario);
  b.play(seconds(50));  // in one leap
  for (Duration now{}; now < seconds(50); now += milliseconds(10)) {
    a.play(now);
    ASSERT_EQ(a.link(0).conditions(Direction::kUp, now).loss,
              b.link(0).conditions(Direction::kUp, now).loss);
  }
}

}  // namespace
}  // namespace interneuron::emu::scenario_player_test
