#include "lab/emu/scenario.h"

#include <gmock/gmock.h>
#include <rapidcheck/gtest.h>

#include "support.h"

namespace interneuron::emu::scenario_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

const std::string kLinks = R"(# Source: this test
schema = 1
description = "a tunnel"
seed = 7
[[link]]
name = "5g"
profile = "5g"
seed = 1154
[[link]]
name = "4g"
profile = "4g"
)";

Scenario read(const std::string& rest) { return value_of(parse_scenario(kLinks + rest, "s.toml")); }
std::string error_of(const std::string& text) { return error_in(parse_scenario(text, "s.toml")); }
// An event begins on line 12.
std::string event_error(const std::string& event) {
  return error_of(kLinks + "[[event]]\n" + event + "\n");
}

std::string with(const std::string& from, const std::string& to) {
  std::string text = kLinks;
  return text.replace(text.find(from), from.size(), to);
}

TEST(Scenario, ReadsEverything) {
  const Scenario scenario = read(R"([coupling]
common_fading = 0.3
[holes]
mean_gap_s = 300
mean_length_s = 5
[[event]]
at_s = 60.5
link = "*"
outage_s = 5
[[event]]
at_s = 10
link = "4g"
profile = "4g-handover"
loss = 0.01
up.rate_mbit = 2
)");
  EXPECT_EQ(scenario.source, "this test");
  EXPECT_EQ(scenario.description, "a tunnel");
  EXPECT_EQ(scenario.seed, 7U);
  ASSERT_EQ(scenario.links.size(), 2U);
  EXPECT_EQ(scenario.links[0].seed, 1154U);
  EXPECT_EQ(scenario.links[1].seed, link_seed(7, 1));
  EXPECT_EQ(scenario.links[1].profile.name, "4g");
  EXPECT_EQ(scenario.common_fading, 0.3);
  EXPECT_EQ(scenario.holes.mean_gap, seconds(300));
  EXPECT_EQ(scenario.holes.mean_length, seconds(5));
  ASSERT_EQ(scenario.events.size(), 2U);
  const ScenarioEvent& change = scenario.events[0];  // by time
  EXPECT_EQ(change.at, seconds(10));
  EXPECT_EQ(change.link, 1U);
  EXPECT_EQ(change.outage, Duration{});
  EXPECT_EQ(change.change.profile->name, "4g-handover");
  EXPECT_EQ(change.change.direction(Direction::kUp).rate, DataRate::mbit(2));
  EXPECT_FALSE(change.change.direction(Direction::kDown).rate);
  EXPECT_EQ(change.change.direction(Direction::kDown).loss, 0.01);
  const ScenarioEvent& outage = scenario.events[1];
  EXPECT_EQ(outage.at, milliseconds(60'500));
  EXPECT_FALSE(outage.link);
  EXPECT_EQ(outage.outage, seconds(5));
}

TEST(Scenario, DefaultsAreNothing) {
  const Scenario scenario = read("");
  EXPECT_EQ(scenario.common_fading, 0);
  EXPECT_EQ(scenario.holes.mean_gap, Duration{});
  EXPECT_TRUE(scenario.events.empty());
}

TEST(ScenarioErrors, OfTheFile) {
  EXPECT_EQ(error_of(with("schema = 1", "schema = 2")),
            "s.toml:2:10: 'schema' = 2 is not known here; this program reads schema 1");
  EXPECT_EQ(error_of(with("seed = 7", "sed = 7")),
            "s.toml:4:1: unknown key 'sed'; did you mean 'seed'?");
  EXPECT_EQ(error_of(with("seed = 7", "seed = -1")),
            "s.toml:4:8: 'seed' must be a whole number, 0 to 9223372036854775807");
  EXPECT_THAT(error_of(with("schema = 1", "schema = ")), StartsWith("s.toml:2:"));
  EXPECT_THAT(
      error_of(kLinks + "[holes]\nmean_gap_s = 10\n"),
      EndsWith("missing key 'mean_length_s' in [holes]: add the mean length of a hole, 0.01 "
               "to 86400 s"));
  EXPECT_EQ(error_of(kLinks + "[coupling]\ncommon_fading = 2\n"),
            "s.toml:13:17: 'common_fading' in [coupling] = 2 is out of range, must be 0 to 1");
}

TEST(ScenarioErrors, OfLinks) {
  EXPECT_EQ(error_of("schema = 1\ndescription = \"x\"\n"),
            "s.toml:1:1: 0 sections [[link]]; there must be 1 to 16");
  EXPECT_EQ(error_of("schema = 1\ndescription = \"x\"\nlink = 5\n"),
            "s.toml:3:8: 'link' is a integer, must be sections: [[link]] and its keys below it");
  EXPECT_EQ(error_of(with("profile = \"5g\"", "profile = \"5gg\"")),
            "s.toml:7:11: no profile '5gg'; did you mean '5g'?");
  EXPECT_EQ(error_of(with("name = \"4g\"", "name = \"5g\"")),
            "s.toml:10:8: 'name' = \"5g\" is another link's already; choose another");
  EXPECT_THAT(error_of(with("name = \"4g\"", "name = \"fourteen-chars\"")),
              HasSubstr("must have 1 to 13 characters"));
  EXPECT_THAT(error_of(with("seed = 1154", "sead = 1154")),
              EndsWith("unknown key 'sead' in [link]; did you mean 'seed'?"));
}

TEST(ScenarioErrors, OfEvents) {
  EXPECT_EQ(event_error("at_s = 1\nlink = \"6g\"\nloss = 1"),
            "s.toml:14:8: 'link' = \"6g\" is no link of this scenario; did you mean \"5g\"?");
  EXPECT_EQ(
      event_error("at_s = 1\nlink = \"satellite\"\nloss = 1"),
      "s.toml:14:8: 'link' = \"satellite\" is no link of this scenario; there are 5g, 4g, and "
      "\"*\" for all");
  EXPECT_EQ(event_error("at_s = -1\nlink = \"*\"\nloss = 1"),
            "s.toml:13:8: 'at_s' in [event] = -1 is out of range, must be 0 to 10000000 s");
  EXPECT_EQ(event_error("at_s = 1\nlink = \"*\"\nlos = 1"),
            "s.toml:15:1: unknown key 'los' in [event]; did you mean 'loss'?");
  EXPECT_EQ(event_error("at_s = 1\nlink = \"*\"\nloss = 2"),
            "s.toml:15:8: 'loss' in [event] = 2 is out of range, must be 0 to 1");
  EXPECT_EQ(event_error("at_s = 1\nlink = \"*\"\nup.rtt_ms = 2"),
            "s.toml:15:4: unknown key 'rtt_ms' in [event.up]; known keys: rate_mbit, queue_kbyte, "
            "queue_packets, loss, duplicate, corrupt, reorder, reorder_ms, mtu, police_mbit, "
            "police_kbyte, shape_mbit, shape_kbyte, grant_ms, grant_share, harq, harq_ms, "
            "wake_after_ms, wake_ms");
  EXPECT_EQ(event_error("at_s = 1\nlink = \"*\"\nprofile = \"4h\""),
            "s.toml:15:11: no profile '4h'; did you mean '4g'?");
  EXPECT_EQ(event_error("at_s = 1\nlink = \"*\""),
            "s.toml:13:8: nothing happens in this [[event]]: add outage_s or a change, as rtt_ms");
  EXPECT_THAT(event_error("at_s = 1\nloss = 0"), HasSubstr("missing key 'link' in [event]"));
  EXPECT_THAT(event_error("link = \"*\"\nloss = 0"), HasSubstr("missing key 'at_s' in [event]"));
  EXPECT_THAT(event_error("at_s = 1\nlink = \"*\"\noutage_s = 0"), HasSubstr("is out of range"));
}

RC_GTEST_PROP(ScenarioErrors, NeverThrows, ()) {
  std::string text = kLinks + "[[event]]\nat_s = 1\nlink = \"*\"\nup.loss = 0.5\n[holes]\n";
  const auto edits = *rc::gen::container<std::vector<std::pair<std::size_t, char>>>(
      rc::gen::pair(rc::gen::inRange<std::size_t>(0, text.size()), rc::gen::arbitrary<char>()));
  for (const auto& [position, character] : edits) text[position] = character;
  const auto result = parse_scenario(text, "s.toml");
  if (const auto* error = std::get_if<ProfileError>(&result)) {
    RC_ASSERT(error->what.starts_with("s.toml:"));
  }
}

TEST(Scenario, LinksShareACell) {
  const std::string cells = R"([[cell]]
name = "town"
profile = "generated-cellular"
codel_target_ms = 5
mark_above_ms = 0
[[cell]]
name = "other"
profile = "clean"
)";
  const Scenario scenario =
      value_of(parse_scenario(with("seed = 1154", "cell = \"town\"") + cells, "s.toml"));
  ASSERT_EQ(scenario.cells.size(), 2U);
  EXPECT_EQ(scenario.links[0].cell, 0U);
  EXPECT_FALSE(scenario.links[1].cell);
  const CellParams& up = scenario.cells[0].up;
  ASSERT_TRUE(up.codel && up.mark_above && up.trace);
  EXPECT_EQ(up.codel->target, milliseconds(5));
  EXPECT_EQ(up.mark_above, Duration{});
  EXPECT_EQ(up.queue_bytes, profile_of("generated-cellular").up.queue_bytes);
  EXPECT_NE(up.rate, scenario.cells[0].down.rate);
  EXPECT_FALSE(scenario.cells[1].up.codel || scenario.cells[1].up.mark_above);
}

TEST(Scenario, ErrorsOfCells) {
  EXPECT_EQ(error_of(with("seed = 1154", "cell = \"town\"")),
            "s.toml:8:8: 'cell' = \"town\" is no [[cell]] of this scenario; add one");
  const std::string cell = "[[cell]]\nname = \"town\"\nprofile = \"clean\"\n";
  EXPECT_EQ(error_of(kLinks + cell + cell),
            "s.toml:16:8: 'name' = \"town\" is another cell's already; choose another");
  EXPECT_THAT(error_of(kLinks + cell + "codel_target_ms = 0\n"),
              HasSubstr("is out of range, must be 0.1 to 1000 ms"));
  EXPECT_THAT(error_of(kLinks + "[[cell]]\nname = \"town\"\n"), HasSubstr("missing key"));
}

}  // namespace
}  // namespace interneuron::emu::scenario_test
