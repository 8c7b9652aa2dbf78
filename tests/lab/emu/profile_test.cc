#include "lab/emu/profile.h"
#include "tests/places.h"

#include <gmock/gmock.h>
#include <rapidcheck/gtest.h>

#include <fstream>
#include <set>
#include <sstream>

#include "support.h"

namespace interneuron::emu::profile_test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::string kGood = R"(# Source: this test
schema = 1
name = "x"
description = "a test"
model = "constant"
rtt_ms = 20
loss = 0.5
[up]
rate_mbit = 10
[down]
rate_mbit = 20
queue_kbyte = 64
)";

// kGood with the first `from` replaced.
std::string with(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const auto position = text.find(from);
  EXPECT_NE(position, std::string::npos) << from;
  return text.replace(position, from.size(), to);
}

std::string error_of(const std::string& text) {
  const auto result = parse_profile(text, "p.toml");
  const auto* error = std::get_if<ProfileError>(&result);
  return error == nullptr ? "no error" : error->what;
}

TEST(Profile, ReadsAConstantOne) {
  const auto result = parse_profile(kGood, "p.toml");
  const auto* profile = std::get_if<LinkProfile>(&result);
  ASSERT_NE(profile, nullptr) << std::get<ProfileError>(result).what;
  EXPECT_EQ(profile->name, "x");
  EXPECT_EQ(profile->description, "a test");
  EXPECT_EQ(profile->source, "this test");
  EXPECT_EQ(profile->delay.min_ms, 20);
  EXPECT_EQ(profile->delay.max_ms, 20);
  EXPECT_EQ(profile->delay.states[2].loss, 0.5);
  EXPECT_EQ(profile->up.rate, DataRate::mbit(10));
  EXPECT_EQ(profile->up.queue_bytes, 375'000U);  // 300 ms
  EXPECT_EQ(profile->down.rate, DataRate::mbit(20));
  EXPECT_EQ(profile->down.queue_bytes, 64'000U);
}

// Its long-run rates are those that scripts/generate_rates.py was asked for.
TEST(Profile, GeneratedRatesHaveTheirMean) {
  const LinkProfile profile = profile_of("generated-cellular");
  ASSERT_TRUE(profile.up.trace && profile.down.trace);
  EXPECT_NEAR(profile.up.rate.mbit(), 6, 0.01);
  EXPECT_NEAR(profile.down.rate.mbit(), 12, 0.01);
  const auto& up = *std::get<std::shared_ptr<const Opportunities>>(*profile.up.trace);
  EXPECT_EQ(up.at_ms.back(), 60'000);
}

TEST(Profile, BuiltInOnesAreTheFilesAndAreValid) {
  std::set<std::string> names;
  for (const BuiltInProfile& built_in : built_in_profiles()) {
    std::ifstream file(places::source() + "/" + std::string(built_in.origin));
    std::stringstream text;
    text << file.rdbuf();
    EXPECT_EQ(text.str(), built_in.text) << built_in.origin;
    const auto result = parse_profile(built_in.text, built_in.origin);
    const auto* profile = std::get_if<LinkProfile>(&result);
    ASSERT_NE(profile, nullptr) << std::get<ProfileError>(result).what;
    EXPECT_EQ(profile->name, built_in.name);
    EXPECT_NE(profile->source, "");
    EXPECT_THAT(std::string(built_in.text), StartsWith("# Source: "));
    names.insert(std::string(built_in.name));
  }
  EXPECT_TRUE(names.count("5g") && names.count("4g") && names.count("clean"));
  EXPECT_FALSE(built_in_profile("6g").has_value());
}

TEST(Profile, RatesOfTheModems) {
  EXPECT_EQ(profile_of("5g").up.rate, DataRate::mbit(100));
  EXPECT_EQ(profile_of("5g").down.rate, DataRate::mbit(300));
  EXPECT_EQ(profile_of("4g").up.rate, DataRate::mbit(30));
  EXPECT_EQ(profile_of("4g").down.rate, DataRate::mbit(75));
}

TEST(ProfileErrors, UnknownKeySuggestsTheNearest) {
  EXPECT_EQ(error_of(with("rate_mbit = 20", "rate_mbits = 20")),
            "p.toml:11:1: unknown key 'rate_mbits' in [down]; did you mean 'rate_mbit'?");
  EXPECT_EQ(error_of(with("model =", "modle =")),
            "p.toml:5:1: unknown key 'modle'; did you mean 'model'?");
  EXPECT_EQ(error_of(with("rtt_ms = 20", "rtt = 20")),
            "p.toml:6:1: unknown key 'rtt'; did you mean 'rtt_ms'?");
  EXPECT_EQ(error_of(with("queue_kbyte = 64", "jitter = 1")),
            "p.toml:12:1: unknown key 'jitter' in [down]; known keys: rate_mbit, queue_kbyte, "
            "queue_packets, loss, duplicate, corrupt, reorder, reorder_ms, mtu, police_mbit, "
            "police_kbyte, shape_mbit, shape_kbyte, grant_ms, grant_share, harq, harq_ms, "
            "wake_after_ms, wake_ms, rate_steps, rate_period_s, rate_trace, gilbert_elliott");
  // A key of another model.
  EXPECT_THAT(error_of(with("loss = 0.5", "loss = 0.5\nramp_tau_s = 1")),
              StartsWith("p.toml:8:1: unknown key 'ramp_tau_s'; known keys: schema"));
}

TEST(ProfileErrors, MissingKeySaysWhatToAdd) {
  EXPECT_EQ(error_of(with("rate_mbit = 20\n", "")),
            "p.toml:10:1: missing key 'rate_mbit' in [down]: add the rate of IP packets, 0.001 to "
            "100000 Mbit/s");
  EXPECT_THAT(error_of(with("name = \"x\"\n", "")),
              HasSubstr("missing key 'name': write name = \""));
  EXPECT_THAT(error_of(with("[up]\nrate_mbit = 10\n", "")),
              HasSubstr("p.toml:1:1: missing section [up]"));
  EXPECT_THAT(error_of(""), StartsWith("p.toml:1:1: missing key 'schema'"));
}

TEST(ProfileErrors, WrongTypeNamesBoth) {
  EXPECT_EQ(error_of(with("rtt_ms = 20", "rtt_ms = \"20\"")),
            "p.toml:6:10: 'rtt_ms' is a string, must be a number without quotes, 0 to 60000 ms");
  EXPECT_THAT(error_of(with("name = \"x\"", "name = 5")),
              StartsWith("p.toml:3:8: 'name' is a integer, must be a string"));
  EXPECT_THAT(error_of(with("[up]\nrate_mbit = 10\n", "up = 3\n")),
              HasSubstr("p.toml:8:6: 'up' is"));
}

TEST(ProfileErrors, OutOfRangeNamesTheRange) {
  EXPECT_EQ(error_of(with("loss = 0.5", "loss = 1.5")),
            "p.toml:7:8: 'loss' = 1.5 is out of range, must be 0 to 1");
  EXPECT_THAT(error_of(with("loss = 0.5", "loss = nan")),
              StartsWith("p.toml:7:8: 'loss' = nan is"));
  EXPECT_THAT(error_of(with("rtt_ms = 20", "rtt_ms = -1")), HasSubstr("must be 0 to 60000 ms"));
  EXPECT_THAT(error_of(with("queue_kbyte = 64", "queue_kbyte = 1e6")),
              HasSubstr("holds more than 10 s at 20 Mbit/s; at most 25000"));
  EXPECT_THAT(error_of(with("schema = 1", "schema = 2")), HasSubstr("this program reads schema 1"));
  EXPECT_THAT(error_of(with("\"x\"", "\"a b\"")), HasSubstr("must have 1 to 64 characters"));
}

TEST(ProfileErrors, UnknownModelSuggests) {
  EXPECT_THAT(
      error_of(with("\"constant\"", "\"constnt\"")),
      HasSubstr("p.toml:5:9: 'model' = \"constnt\" is not known; did you mean \"constant\"?"));
  EXPECT_THAT(error_of(with("\"constant\"", "\"trace\"")), HasSubstr("there are \"three-state\""));
}

TEST(ProfileErrors, MaximumBelowMinimum) {
  std::string text;
  for (const BuiltInProfile& built_in : built_in_profiles()) {
    if (built_in.name == "5g") text = built_in.text;
  }
  const auto position = text.find("rtt_max_ms = 96");
  ASSERT_NE(position, std::string::npos);
  EXPECT_THAT(error_of(text.replace(position, 15, "rtt_max_ms = 9")),
              HasSubstr("'rtt_max_ms' = 9 is below 'rtt_min_ms' = 19"));
}

TEST(ProfileErrors, SyntaxErrorHasAPosition) {
  EXPECT_THAT(error_of(with("schema = 1", "schema = ")), StartsWith("p.toml:2:"));
  EXPECT_THAT(error_of("a = 1\na = 2\n"), StartsWith("p.toml:2:"));
  EXPECT_THAT(error_of("a = \"\xff\xfe\"\n"), StartsWith("p.toml:1:"));
}

// A mutation of a good file is read or refused in one line, never thrown.
RC_GTEST_PROP(ProfileErrors, NeverThrows, ()) {
  std::string text = kGood;
  const auto edits = *rc::gen::container<std::vector<std::pair<std::size_t, char>>>(
      rc::gen::pair(rc::gen::inRange<std::size_t>(0, kGood.size()), rc::gen::arbitrary<char>()));
  for (const auto& [position, character] : edits) text[position] = character;
  const auto result = parse_profile(text, "p.toml");
  if (const auto* error = std::get_if<ProfileError>(&result)) {
    RC_ASSERT(error->what.rfind("p.toml:", 0) == 0);
  }
}

TEST(LinkSeed, DiffersByLinkAndSeedAndDoesNotDependOnOthers) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (std::size_t link = 0; link < 16; ++link) seen.insert(link_seed(seed, link));
  }
  EXPECT_EQ(seen.size(), 1600U);
}

}  // namespace
}  // namespace interneuron::emu::profile_test
