#include "lab/emu/link.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support.h"

namespace interneuron::emu::link_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

LinkChange change_of(const std::vector<std::string>& pairs) {
  return value_of(parse_change(pairs));
}

TEST(Link, SeedIsThatOfTheProcess) {
  Link link(profile_of("4g"), 1287);
  DelayProcess alone(profile_of("4g").delay, 1287);
  for (Duration t{}; t < seconds(200); t += kDelayStep) {
    ASSERT_EQ(link.process()->at(t).rtt, alone.at(t).rtt);
    ASSERT_EQ(link.conditions(Direction::kUp, t).one_way, alone.at(t).rtt / 2);
  }
}

TEST(Link, ConditionsAreThoseOfTheDirection) {
  LinkProfile profile = constant_profile(40, 0.01);
  profile.up.queue_packets = 7;
  profile.down.loss = 0.5;
  profile.down.gilbert_elliott = GilbertElliott{0.1, 0.2};
  profile.down.duplicate = 0.1;
  profile.down.corrupt = 0.2;
  profile.down.reorder = 0.3;
  profile.down.mtu = 1400;
  Link link(profile, 1);
  const Conditions up = link.conditions(Direction::kUp, seconds(1));
  EXPECT_EQ(up.one_way, milliseconds(20));
  EXPECT_EQ(up.loss, 0.01);
  EXPECT_FALSE(up.gilbert_elliott);
  EXPECT_EQ(up.rate, DataRate::mbit(100));
  EXPECT_EQ(up.queue_bytes, kMegabyte);
  EXPECT_EQ(up.queue_packets, 7U);
  const Conditions down = link.conditions(Direction::kDown, seconds(1));
  EXPECT_EQ(down.loss, 0.5);
  EXPECT_EQ(down.gilbert_elliott, (GilbertElliott{0.1, 0.2}));
  EXPECT_EQ(down.duplicate, 0.1);
  EXPECT_EQ(down.corrupt, 0.2);
  EXPECT_EQ(down.reorder, 0.3);
  EXPECT_EQ(down.reorder_by, milliseconds(20));
  EXPECT_EQ(down.mtu, 1400U);
}

TEST(Link, ConditionsInAnOutageAndOfARateInTime) {
  LinkProfile profile = constant_profile(40);
  profile.up.trace = std::make_shared<const SteppedRate>(
      SteppedRate{{{Duration{}, DataRate::mbit(10)}, {seconds(1), DataRate::mbit(30)}}, {}});
  Link link(profile, 1);
  link.outage(seconds(5), seconds(1));
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(4)).loss, 0);
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(5)).loss, 1);
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(6)).loss, 0);
  EXPECT_EQ(link.conditions(Direction::kUp, milliseconds(990)).rate, DataRate::mbit(20));
}

TEST(Link, AnOutageToldAheadLosesWhatLeavesInIt) {
  Link link(constant_profile(20), 1);
  link.outage(seconds(2), seconds(3));
  link.outage(seconds(4), seconds(2));  // unites with the first
  link.outage(seconds(1), milliseconds(500));
  for (int i = 0; i < 80; ++i) {
    const Duration now = milliseconds(100) * i;
    const bool out = (i >= 10 && i < 15) || (i >= 20 && i < 60);
    EXPECT_EQ(link.up().enqueue(now, 100, 0), !out) << i;
    EXPECT_EQ(link.down().enqueue(now, 100, 0), !out) << i;
  }
}

TEST(Link, AnOutageToldLateTakesWhatWaits) {
  LinkProfile profile = constant_profile(20);
  profile.up.rate = DataRate::mbit(8);  // 1000 bytes per ms
  Link link(profile, 1);
  for (std::uint64_t i = 0; i < 10; ++i) ASSERT_TRUE(link.up().enqueue({}, 1000, i));
  link.outage(microseconds(3500), milliseconds(4));
  const auto out = drain(link.up());
  ASSERT_EQ(out.size(), 10U);  // each comes out, to be freed
  for (const LinkModel::Packet& packet : out) {
    const bool lost = packet.tag >= 3 && packet.tag <= 6;  // left at 4, 5, 6 and 7 ms
    EXPECT_EQ(packet.lost, lost) << packet.tag;
    EXPECT_TRUE(packet.last);
  }
  EXPECT_EQ(link.up().stats().outage_lost, 4U);
  EXPECT_EQ(link.up().stats().delivered, 6U);
}

TEST(Link, AChangeOfDelayHoldsFromNowOn) {
  Link link(constant_profile(20), 1);
  ASSERT_TRUE(link.up().enqueue(seconds(1), 1250, 0));
  link.change(seconds(1) + milliseconds(1), change_of({"rtt_ms=80"}));
  EXPECT_EQ(link.up().next_delivery(), seconds(1) + microseconds(10'100));  // was on its way
  ASSERT_TRUE(link.up().enqueue(seconds(2), 1250, 1));
  drain(link.up(), seconds(2));
  EXPECT_EQ(link.up().next_delivery(), seconds(2) + microseconds(40'100));
  EXPECT_EQ(link.conditions(Direction::kDown, seconds(2)).one_way, milliseconds(40));
  link.change(seconds(3), change_of({"rtt_ms=2"}));
  ASSERT_TRUE(link.up().enqueue(seconds(3), 1250, 2));
  drain(link.up(), seconds(3));
  EXPECT_EQ(link.up().next_delivery(), seconds(3) + microseconds(1'100));
}

TEST(Link, AChangeOfDelayNeverReorders) {
  Link link(constant_profile(200), 1);
  for (std::uint64_t i = 0; i < 100; ++i) {
    if (i == 50) link.change(milliseconds(i), change_of({"rtt_ms=10"}));
    ASSERT_TRUE(link.up().enqueue(milliseconds(i), 1000, i));
  }
  const auto out = drain(link.up());
  for (std::uint64_t i = 0; i < 100; ++i) EXPECT_EQ(out[i].tag, i);
}

TEST(Link, AChangeOfRateHoldsForWhatWaits) {
  LinkProfile profile = constant_profile(20);
  profile.up.rate = DataRate::mbit(8);
  Link link(profile, 1);
  for (std::uint64_t i = 0; i < 5; ++i) ASSERT_TRUE(link.up().enqueue({}, 1000, i));
  link.change(microseconds(1500), change_of({"up.rate_mbit=80"}));
  std::vector<Duration> dues;
  for (const auto& packet : drain(link.up())) dues.push_back(packet.due - milliseconds(10));
  EXPECT_THAT(dues, ElementsAre(milliseconds(1), milliseconds(2), microseconds(2100),
                                microseconds(2200), microseconds(2300)));
  EXPECT_EQ(link.conditions(Direction::kDown, {}).rate, DataRate::mbit(100));
}

TEST(Link, AMuchLowerRateGivesUpWhatWouldWaitTooLong) {
  LinkProfile profile = constant_profile(20);
  profile.up.rate = DataRate::mbit(8);
  Link link(profile, 1);
  for (std::uint64_t i = 0; i < 20; ++i) ASSERT_TRUE(link.up().enqueue({}, 1000, i));
  link.change({}, change_of({"rate_mbit=0.004"}));  // one in 2 s
  std::uint64_t through = 0;
  for (const auto& packet : drain(link.up())) through += packet.lost ? 0U : 1U;
  EXPECT_EQ(through, 5U);
  EXPECT_EQ(link.up().stats().queue_drops, 15U);
  EXPECT_TRUE(link.up().enqueue(seconds(11), 1000, 99));
}

TEST(Link, AnotherProfileBeginsAtItsChange) {
  Link link(profile_of("clean"), 3);
  link.change(seconds(100), change_of({"profile=outage", "loss=0.25"}));
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(119)).loss, 0.25);
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(120)).loss, 1);  // 20 s into its drive
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(125)).loss, 0.25);
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(125)).one_way, milliseconds(20));
  EXPECT_EQ(link.conditions(Direction::kUp, seconds(125)).rate, DataRate::mbit(20));
}

TEST(Link, LossReplacesBurstsToo) {
  Link link(profile_of("lossy"), 3);
  ASSERT_TRUE(link.conditions(Direction::kUp, {}).gilbert_elliott);
  link.change(seconds(1), change_of({"up.loss=0"}));
  EXPECT_FALSE(link.conditions(Direction::kUp, {}).gilbert_elliott);
  EXPECT_TRUE(link.conditions(Direction::kDown, {}).gilbert_elliott);
}

TEST(Link, NamesWhatNetemCannotOfAChange) {
  const auto missing = [](const std::string& setting) {
    return netem_cannot(change_of({setting}));
  };
  for (const char* fine : {"rtt_ms=50", "loss=0.1", "rate_mbit=5", "profile=4g", "reorder=0.1"}) {
    EXPECT_THAT(missing(fine), IsEmpty()) << fine;
  }
  EXPECT_THAT(missing("up.mtu=1300"), ElementsAre(HasSubstr("mtu")));
  EXPECT_THAT(missing("reorder_ms=5"), ElementsAre(HasSubstr("reorder_ms")));
  EXPECT_FALSE(missing("profile=carrier-nat").empty());
  for (const char* key : {"police_mbit", "shape_mbit", "grant_ms", "harq", "wake_ms"}) {
    EXPECT_THAT(missing(std::string(key) + "=1"), ElementsAre(HasSubstr(key)));
    EXPECT_THAT(missing(std::string(key) + "=0"), IsEmpty()) << key;
  }
}

TEST(NetemCannot, NamesWhatItHasNoMeansFor) {
  for (const char* name : {"4g", "5g", "clean", "lossy", "outage", "4g-congestion"}) {
    EXPECT_THAT(netem_cannot(profile_of(name)), IsEmpty()) << name;
  }
  EXPECT_THAT(netem_cannot(profile_of("carrier-nat")),
              ElementsAre(HasSubstr("drop_below"), HasSubstr("reorder_above"), HasSubstr("idle")));
  LinkProfile profile = constant_profile(20);
  profile.down.mtu = 1400;
  profile.up.reorder = 0.1;
  profile.up.reorder_by = milliseconds(3);
  profile.up.trace = std::make_shared<const Opportunities>(Opportunities{{1}});
  EXPECT_THAT(netem_cannot(profile), ElementsAre(HasSubstr("finer than 20 ms"), HasSubstr("mtu"),
                                                 HasSubstr("reorder_ms")));
}

}  // namespace
}  // namespace interneuron::emu::link_test
