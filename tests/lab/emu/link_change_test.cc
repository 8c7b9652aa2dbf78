#include "lab/emu/link_change.h"

#include <gmock/gmock.h>
#include <rapidcheck/gtest.h>

#include "support.h"

namespace interneuron::emu::link_change_test {
namespace {

using testing::StartsWith;

std::string error_of(const std::vector<std::string>& pairs) {
  return error_in(parse_change(pairs));
}

TEST(LinkChange, ReadsEveryKey) {
  const LinkChange change = value_of(parse_change(std::vector<std::string>{
      "rtt_ms=80",         "loss=0.01",     "rate_mbit=5",        "queue_kbyte=64",
      "queue_packets=100", "duplicate=0.1", "corrupt=0.2",        "reorder=0.3",
      "reorder_ms=4",      "mtu=1400",      "profile=4g",         "police_mbit=10",
      "police_kbyte=20",   "shape_mbit=30", "grant_ms=5",         "grant_share=0.4",
      "harq=0.1",          "harq_ms=4",     "wake_after_ms=5000", "wake_ms=200"}));
  EXPECT_EQ(change.rtt, std::chrono::milliseconds(80));
  ASSERT_NE(change.profile, nullptr);
  EXPECT_EQ(change.profile->name, "4g");
  for (const Direction d : {Direction::kUp, Direction::kDown}) {
    DirectionParams params;
    change.direction(d).apply_to(params);
    EXPECT_EQ(params.loss, 0.01);
    EXPECT_EQ(params.rate, DataRate::mbit(5));
    EXPECT_EQ(params.queue_bytes, 64'000U);
    EXPECT_EQ(params.queue_packets, 100U);
    EXPECT_EQ(params.duplicate, 0.1);
    EXPECT_EQ(params.corrupt, 0.2);
    EXPECT_EQ(params.reorder, 0.3);
    EXPECT_EQ(params.reorder_by, std::chrono::milliseconds(4));
    EXPECT_EQ(params.mtu, 1400U);
    EXPECT_EQ(params.police, (TokenBucketParams{DataRate::mbit(10), 20'000}));
    // 50 ms at its rate.
    EXPECT_EQ(params.shape, (TokenBucketParams{DataRate::mbit(30), 187'500}));
    EXPECT_EQ(params.grant_every, std::chrono::milliseconds(5));
    EXPECT_EQ(params.grant_share, 0.4);
    EXPECT_EQ(params.harq, 0.1);
    EXPECT_EQ(params.harq_by, std::chrono::milliseconds(4));
    EXPECT_EQ(params.wake_after, std::chrono::seconds(5));
    EXPECT_EQ(params.wake_by, std::chrono::milliseconds(200));
  }
}

TEST(LinkChange, ADirectionOfItsOwn) {
  const LinkChange change =
      value_of(parse_change(std::vector<std::string>{"loss=0.01", "up.loss=0.5", "down.mtu=1300"}));
  EXPECT_EQ(change.direction(Direction::kUp).loss, 0.5);
  EXPECT_EQ(change.direction(Direction::kDown).loss, 0.01);
  EXPECT_FALSE(change.direction(Direction::kUp).mtu);
  EXPECT_EQ(change.direction(Direction::kDown).mtu, 1300U);
}

TEST(LinkChange, ErrorsSayWhatToDo) {
  EXPECT_EQ(error_of({}), "no change given; write KEY=VALUE, as rtt_ms=80");
  EXPECT_EQ(error_of({"loss"}), "'loss' is no KEY=VALUE; write rtt_ms=80");
  EXPECT_EQ(error_of({"los=1"}), "unknown key 'los'; did you mean 'loss'?");
  EXPECT_EQ(error_of({"up.lss=1"}), "unknown key 'up.lss'; did you mean 'up.loss'?");
  EXPECT_EQ(error_of({"up.rtt_ms=1"}), "unknown key 'up.rtt_ms'; did you mean 'rtt_ms'?");
  EXPECT_EQ(error_of({"altitude_m=1"}),
            "unknown key 'altitude_m'; known keys: rtt_ms, profile, rate_mbit, queue_kbyte, "
            "queue_packets, loss, duplicate, corrupt, reorder, reorder_ms, mtu, police_mbit, "
            "police_kbyte, shape_mbit, shape_kbyte, grant_ms, grant_share, harq, harq_ms, "
            "wake_after_ms, wake_ms; all but the first two also as up.KEY or down.KEY");
  EXPECT_EQ(error_of({"loss=2"}), "'loss' = 2 is out of range, must be 0 to 1");
  EXPECT_EQ(error_of({"rtt_ms=-1"}), "'rtt_ms' = -1 is out of range, must be 0 to 60000 ms");
  EXPECT_EQ(error_of({"down.mtu=99.5"}),
            "'down.mtu' = 99.5 must be a whole number, 68 to 65535 IP bytes");
  EXPECT_EQ(error_of({"loss=nan"}), "'loss' = nan is out of range, must be 0 to 1");
  EXPECT_EQ(error_of({"loss=1%"}), "'loss' = '1%' must be a number, 0 to 1");
  EXPECT_EQ(error_of({"loss="}), "'loss' = '' must be a number, 0 to 1");
  EXPECT_EQ(error_of({"profile=4h"}), "no profile '4h'; did you mean '4g'?");
  EXPECT_THAT(error_of({"profile=metro"}), StartsWith("no profile 'metro'; there are 4g, "));
}

TEST(LinkChange, ProfilesComeFromTheResolver) {
  const auto resolver = [](const std::string& name) -> std::variant<LinkProfile, ProfileError> {
    if (name != "./mine.toml") return ProfileError{"./x.toml: no such file"};
    return constant_profile(7);
  };
  const std::vector<std::string> good{"profile=./mine.toml"};
  EXPECT_EQ(value_of(parse_change(good, resolver)).profile->name, "constant");
  const std::vector<std::string> bad{"profile=./x.toml"};
  EXPECT_EQ(error_in(parse_change(bad, resolver)), "./x.toml: no such file");
}

RC_GTEST_PROP(LinkChange, NeverThrows, (const std::vector<std::string>& pairs)) {
  const auto result = parse_change(pairs);
  RC_ASSERT(result.index() < 2);
}

}  // namespace
}  // namespace interneuron::emu::link_change_test
