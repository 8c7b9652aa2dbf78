// Every further part of a profile: what it means and how its errors read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "lab/emu/link_change.h"
#include "lab/emu/scenario.h"
#include "support.h"

namespace interneuron::emu::profile_error_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::EndsWith;
using testing::HasSubstr;

// A profile with these lines in [up] and these sections at its end.
std::string text_of(const std::string& up, const std::string& sections = "") {
  return "schema = 1\nname = \"x\"\ndescription = \"a test\"\nmodel = \"constant\"\nrtt_ms = 20\n"
         "loss = 0\n[down]\nrate_mbit = 20\n[up]\n" +
         up + "\n" + sections;  // [up] is line 9
}

std::string traced(const std::string& keys) {
  return "schema = 1\nname = \"x\"\ndescription = \"a test\"\nmodel = \"delay-trace\"\n" + keys +
         "\n[down]\nrate_mbit = 20\n[up]\nrate_mbit = 20\n";
}

// The files of these tests.
std::variant<std::string, FileError> load(const std::string& name) {
  if (name == "good.rtt") return "# Source: a test\n# step_s = 1\n10\n20\n";
  if (name == "cut.rtt") return "# Source: a test\n# step_s = 1\n10\n2";
  if (name == "good.mahi") return "1\n2\n3\n";
  if (name == "bad.mahi") return "1\nx\n";
  if (name == "throws") throw std::runtime_error("disk on fire");
  return FileError{"No such file or directory"};
}

LinkProfile read(const std::string& text) { return value_of(parse_profile(text, "p.toml", load)); }
std::string error_of(const std::string& text) {
  return error_in(parse_profile(text, "p.toml", load));
}

TEST(ProfileParts, AnErrorIsOneLineWhateverTheTextIs) {
  const auto is_one_line = [](const auto& parsed) {
    const auto* error = std::get_if<ProfileError>(&parsed);
    return error != nullptr && error->what.find_first_of("\n\x1b") == std::string::npos;
  };
  EXPECT_TRUE(is_one_line(parse_profile("# Source: x\nschema = t\n", "x.toml")));
  EXPECT_TRUE(is_one_line(parse_profile("\"a\\n\\u001b[2J\" = 1\n", "x.toml")));
  EXPECT_TRUE(is_one_line(parse_scenario("seed = t\n", "x.toml")));
  const std::string setting = "lo\nss=1";
  EXPECT_TRUE(is_one_line(parse_change(std::span(&setting, 1))));
}

TEST(ProfileParts, ADirection) {
  const LinkProfile profile = read(
      text_of("rate_mbit = 10\nqueue_kbyte = 64\nqueue_packets = 50\nloss = 0.1\nduplicate = 0.2\n"
              "corrupt = 0.3\nreorder = 0.4\nreorder_ms = 5\nmtu = 1400\n"
              "[up.gilbert_elliott]\np = 0.01\nr = 0.2\nloss_in_good = 0.001\nloss_in_bad = 0.9"));
  EXPECT_EQ(profile.up.queue_packets, 50U);
  EXPECT_EQ(profile.up.loss, 0.1);
  EXPECT_EQ(profile.up.duplicate, 0.2);
  EXPECT_EQ(profile.up.corrupt, 0.3);
  EXPECT_EQ(profile.up.reorder, 0.4);
  EXPECT_EQ(profile.up.reorder_by, milliseconds(5));
  EXPECT_EQ(profile.up.mtu, 1400U);
  EXPECT_EQ(profile.up.gilbert_elliott, (GilbertElliott{0.01, 0.2, 0.001, 0.9}));
  EXPECT_FALSE(profile.down.gilbert_elliott);
  EXPECT_EQ(profile.down.reorder_by, DirectionParams::kWholeDelay);
}

TEST(ProfileParts, WhatCarriersDoToPackets) {
  const LinkProfile profile = read(
      text_of("rate_mbit = 100\npolice_mbit = 20\nshape_mbit = 10\nshape_kbyte = 64\ngrant_ms = 5\n"
              "harq = 0.1\nwake_ms = 200"));
  EXPECT_EQ(profile.up.police, (TokenBucketParams{DataRate::mbit(20), 125'000}));
  EXPECT_EQ(profile.up.shape, (TokenBucketParams{DataRate::mbit(10), 64'000}));
  // 300 ms at the rate that empties it.
  EXPECT_EQ(profile.up.queue_bytes, 375'000U);
  EXPECT_EQ(profile.up.grant_every, milliseconds(5));
  EXPECT_EQ(profile.up.grant_share, DirectionParams::kGrantShare);
  EXPECT_EQ(profile.up.harq_by, DirectionParams::kHarqBy);
  EXPECT_EQ(profile.up.wake_after, DirectionParams::kWakeAfter);
  EXPECT_EQ(profile.up.wake_by, milliseconds(200));
  EXPECT_EQ(profile.down.police, TokenBucketParams{});
}

TEST(ProfileParts, KeysThatNeedAnother) {
  EXPECT_EQ(error_of(text_of("rate_mbit = 1\npolice_kbyte = 20")),
            "p.toml:11:16: 'police_kbyte' in [up] needs 'police_mbit'");
  EXPECT_EQ(error_of(text_of("rate_mbit = 1\nwake_after_ms = 20")),
            "p.toml:11:17: 'wake_after_ms' in [up] needs 'wake_ms'");
  EXPECT_EQ(error_of(text_of("rate_steps = [[0, 1]]\ngrant_ms = 5")),
            "p.toml:11:12: 'grant_ms' in [up] is for a constant rate_mbit; leave it out beside "
            "steps and traces");
}

TEST(ProfileParts, DirectionErrors) {
  EXPECT_EQ(error_of(text_of("rate_mbit = 1\nqueue_packets = 2.5")),
            "p.toml:11:17: 'queue_packets' in [up] = 2.5 must be a whole number, 1 to 10000000 "
            "packets");
  EXPECT_EQ(error_of(text_of("rate_mbit = 1\nmtu = 20")),
            "p.toml:11:7: 'mtu' in [up] = 20 is out of range, must be 68 to 65535 IP bytes");
  EXPECT_EQ(error_of(text_of("rate_mbit = 1\n[up.gilbert_elliott]\np = 0.1\nr = 0")),
            "p.toml:13:5: 'r' in [up.gilbert_elliott] = 0 is out of range, must be 0.001 to 1");
  EXPECT_THAT(error_of(text_of("rate_mbit = 1\n[up.gilbert_elliott]\np = 0.1")),
              HasSubstr("missing key 'r' in [up.gilbert_elliott]"));
  EXPECT_THAT(error_of(text_of("rate_mbit = 1\n[up.gilbert_elliot]\np = 0.1")),
              EndsWith("unknown key 'gilbert_elliot' in [up]; did you mean 'gilbert_elliott'?"));
}

TEST(ProfileParts, RatesInTime) {
  const LinkProfile steps = read(text_of("rate_steps = [[0, 30], [2.5, 10]]\nrate_period_s = 5"));
  EXPECT_EQ(steps.up.rate, DataRate::mbit(20));
  EXPECT_EQ(steps.up.queue_bytes, 750'000U);  // 300 ms at the mean
  const auto& stepped = *std::get<0>(*steps.up.trace);
  EXPECT_EQ(stepped.period, seconds(5));
  EXPECT_EQ(stepped.steps[1].at, milliseconds(2500));
  const LinkProfile trace = read(text_of("rate_trace = \"good.mahi\""));
  EXPECT_EQ(trace.up.rate, DataRate::mbit(12));
  EXPECT_EQ(std::get<1>(*trace.up.trace)->at_ms.size(), 3U);
}

TEST(ProfileParts, RateErrors) {
  EXPECT_THAT(error_of(text_of("queue_packets = 5")), HasSubstr("missing key 'rate_mbit' in [up]"));
  EXPECT_EQ(
      error_of(text_of("rate_mbit = 5\nrate_steps = [[0, 1]]")),
      "p.toml:11:14: [up] has more than one of rate_mbit, rate_steps and rate_trace; keep one");
  EXPECT_EQ(error_of(text_of("rate_mbit = 5\nrate_period_s = 3")),
            "p.toml:11:17: 'rate_period_s' in [up] needs 'rate_steps'");
  EXPECT_EQ(error_of(text_of("rate_steps = 5")),
            "p.toml:10:14: 'rate_steps' in [up] must be a list [[at_s, rate_mbit], ...]");
  EXPECT_EQ(error_of(text_of("rate_steps = [[0, 1], [2]]")),
            "p.toml:10:23: 'rate_steps' in [up] must be a list [[at_s, rate_mbit], ...]");
  EXPECT_EQ(
      error_of(text_of("rate_steps = [[0, -1]]")),
      "p.toml:10:15: 'rate_steps' in [up]: rate_mbit = -1 is out of range, must be 0 to 100000 "
      "Mbit/s");
  EXPECT_THAT(error_of(text_of("rate_steps = [[1, 1]]")),
              EndsWith("'rate_steps' in [up] must begin at 0 s and rise; 1 does not"));
  EXPECT_THAT(error_of(text_of("rate_steps = [[0, 1], [5, 2], [5, 3]]")),
              EndsWith("must begin at 0 s and rise; 5 does not"));
  EXPECT_THAT(error_of(text_of("rate_steps = [[0, 0]]")),
              EndsWith("'rate_steps' in [up] is 0 everywhere; nothing would ever pass"));
  EXPECT_THAT(error_of(text_of("rate_steps = [[0, 1], [5, 2]]\nrate_period_s = 5")),
              EndsWith("'rate_period_s' in [up] = 5 must be beyond the last step"));
  EXPECT_EQ(error_of(text_of("rate_trace = \"bad.mahi\"")),
            "p.toml:10:14: trace \"bad.mahi\": line 2: 'x' must be a whole number of ms");
  EXPECT_EQ(error_of(text_of("rate_trace = \"gone.mahi\"")),
            "p.toml:10:14: trace \"gone.mahi\" cannot be read: No such file or directory; name it "
            "relative to this profile's folder");
}

TEST(ProfileParts, DelayTraces) {
  const LinkProfile profile = read(traced("rtt_trace = \"good.rtt\"\nloss = 0.1"));
  EXPECT_EQ(profile.delay.trace->rtt_ms, (std::vector<double>{10, 20}));
  EXPECT_FALSE(profile.delay.random_start);
  EXPECT_EQ(profile.delay.states[0].loss, 0.1);
  EXPECT_EQ(profile.delay.min_ms, 10);
  EXPECT_EQ(profile.delay.max_ms, 20);
  EXPECT_TRUE(read(traced("rtt_trace = \"good.rtt\"\nstart = \"random\"")).delay.random_start);
  // A copy of a built-in profile finds its trace anywhere.
  EXPECT_NE(read(traced("rtt_trace = \"traces/lte-sprint-highway.rtt\"")).delay.trace, nullptr);
}

TEST(ProfileParts, DelayTraceErrors) {
  EXPECT_EQ(error_of(traced("rtt_trace = \"gone.rtt\"")),
            "p.toml:5:13: trace \"gone.rtt\" cannot be read: No such file or directory; name it "
            "relative to this profile's folder");
  EXPECT_EQ(
      error_of(traced("rtt_trace = \"cut.rtt\"")),
      "p.toml:5:13: trace \"cut.rtt\": line 4: the file is cut off: its last line has no end");
  EXPECT_EQ(error_of(traced("rtt_trace = \"good.mahi\"")),
            "p.toml:5:13: trace \"good.mahi\": line 1: must be \"# Source: WHERE FROM\"");
  EXPECT_EQ(error_of(traced("rtt_trace = \"throws\"")), "p.toml: cannot be read: disk on fire");
  EXPECT_EQ(error_of(traced("rtt_trace = \"good.rtt\"\nstart = \"middle\"")),
            "p.toml:6:9: 'start' = \"middle\" must be \"beginning\" or \"random\"");
  EXPECT_THAT(error_of(traced("")), HasSubstr("missing key 'rtt_trace': write rtt_trace = "));
  EXPECT_THAT(error_of(traced("rtt_trace = \"good.rtt\"\nrtt_ms = 5")),
              HasSubstr("unknown key 'rtt_ms'"));
  const auto without = parse_profile(traced("rtt_trace = \"good.rtt\""), "p.toml");
  EXPECT_THAT(error_in(without), HasSubstr("cannot be read: there is no such built-in trace"));
}

TEST(ProfileParts, OutagesAndNat) {
  const LinkProfile profile = read(
      text_of("rate_mbit = 1",
              "[outages]\nfirst_s = 1\nlength_s = 2\nevery_s = 5\n[nat]\ndrop_below_bytes = 60\n"
              "reorder_above_bytes = 1440\nreorder = 0.03\nreorder_ms = 4\nidle_timeout_s = 15\n"));
  EXPECT_EQ(profile.outages.first, seconds(1));
  EXPECT_EQ(profile.outages.length, seconds(2));
  EXPECT_EQ(profile.outages.every, seconds(5));
  EXPECT_EQ(profile.nat.drop_below, 60U);
  EXPECT_EQ(profile.nat.reorder_above, 1440U);
  EXPECT_EQ(profile.nat.reorder, 0.03);
  EXPECT_EQ(profile.nat.reorder_delay, milliseconds(4));
  EXPECT_EQ(profile.nat.idle_timeout, seconds(15));
}

TEST(ProfileParts, OutageAndNatErrors) {
  EXPECT_EQ(error_of(text_of("rate_mbit = 1", "[outages]\nfirst_s = 1\nlength_s = 2\nevery_s = 2")),
            "p.toml:14:11: 'every_s' in [outages] = 2 must be above 'length_s' = 2");
  EXPECT_THAT(error_of(text_of("rate_mbit = 1", "[outages]\nfirst_s = 1")),
              HasSubstr("missing key 'length_s' in [outages]: add the length of each outage"));
  EXPECT_THAT(error_of(text_of("rate_mbit = 1", "[nat]\nidle_timeout = 1")),
              EndsWith("unknown key 'idle_timeout' in [nat]; did you mean 'idle_timeout_s'?"));
  EXPECT_THAT(error_of(text_of("rate_mbit = 1", "[nat]\ndrop_below_bytes = 1e9")),
              EndsWith("is out of range, must be 0 to 65535 IP bytes"));
}

TEST(ProfileParts, EveryTroubleOfThePaperHasAProfile) {
  for (const char* name :
       {"4g-leaving-cell", "4g-handover", "4g-congestion", "5g-handover", "5g-congestion", "lossy",
        "outage", "satellite", "wifi-roaming", "carrier-nat", "lte-verizon-downtown",
        "lte-sprint-downtown", "lte-verizon-highway", "lte-sprint-highway"}) {
    Link link(profile_of(name), 1);
    EXPECT_GT(stream(link.up(), 1000, milliseconds(5)), 300U) << name;
  }
}

}  // namespace
}  // namespace interneuron::emu::profile_error_test
