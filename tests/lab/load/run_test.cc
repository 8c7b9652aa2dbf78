// Runs under load, short ones: what any transport does below capacity, and that a run is the same
// every time.
#include "lab/load/run.h"

#include <gtest/gtest.h>

namespace interneuron::load::run_test {
namespace {

using namespace std::chrono_literals;

Row run_first(const char* group, Peer peer, double load, Duration length) {
  Choice choice;
  choice.peers = {peer};
  choice.length = length;
  if (load > 0) choice.loads = {load};
  return run(scenarios(group, choice).front());
}

TEST(Run, BelowCapacityNothingIsMissed) {
  const Row row = run_first("rate", Peer::kOurs, 0.5, 3s);
  EXPECT_GT(row.messages, 50U);
  EXPECT_EQ(row.missed, 0U);
  EXPECT_NEAR(row.of_possible, 1, 1e-9);
  EXPECT_NEAR(row.utilisation, 0.5, 0.03);
  // The link's own time for a message of 48 KiB is 20.8 ms; one way adds 20 ms.
  EXPECT_GT(row.age_p50_ms, 40);
  EXPECT_LT(row.age_p99_ms, 60);
}

TEST(Run, TheSameScenarioGivesTheSameRow) {
  const Row a = run_first("rate", Peer::kOurs, 1.2, 2s);
  const Row b = run_first("rate", Peer::kOurs, 1.2, 2s);
  EXPECT_EQ(a.missed, b.missed);
  EXPECT_EQ(a.on_time_goodput_mbit, b.on_time_goodput_mbit);
  EXPECT_EQ(a.queue_p99_ms, b.queue_p99_ms);
}

TEST(Run, EncryptionCostsNoGoodput) {
  Choice choice{.peers = {Peer::kOurs}, .loads = {1.2}, .length = 5s};
  const Row clear = run(scenarios("rate", choice).front());
  choice.is_encrypted = true;
  const Row sealed = run(scenarios("rate", choice).front());
  EXPECT_GE(sealed.on_time_goodput_mbit, 0.98 * clear.on_time_goodput_mbit);
}

TEST(Run, ADipIsSeenInTheFiguresOfTheBottleneck) {
  const Row row = run_first("dip", Peer::kOurs, 0, 12s);
  // 3 s at a tenth of the rate, into which twice as much is offered.
  EXPECT_GT(row.missed, 20U);
  EXPECT_GT(row.queue_p99_ms, 100);
  ASSERT_TRUE(row.whole_after_ms.has_value());
  EXPECT_GE(*row.whole_after_ms, 0);
}

// Every transport, in conditions in which none of them misses much.
class RunOf : public testing::TestWithParam<Peer> {};

TEST_P(RunOf, BelowCapacityHardlyAnythingIsMissed) {
  const Row row = run_first("rate", GetParam(), 0.5, 5s);
  EXPECT_LE(row.missed, row.messages / 20);
  EXPECT_GT(row.of_possible, 0.95);
  EXPECT_NEAR(row.utilisation, 0.5, 0.05);
}

TEST_P(RunOf, AboveCapacityTheLinkIsFullOrTheMessagesSmaller) {
  const Row row = run_first("rate", GetParam(), 2, 5s);
  EXPECT_TRUE(row.utilisation > 0.9 || row.degraded > row.messages / 2) << row.utilisation;
  EXPECT_LE(row.of_possible, 1.06);
  EXPECT_LE(row.queue_p99_ms, 31);
}

INSTANTIATE_TEST_SUITE_P(Peers, RunOf,
                         testing::Values(Peer::kOurs, Peer::kOursVariants, Peer::kUdp, Peer::kCubic,
                                         Peer::kBbrLike, Peer::kMptcpLike),
                         [](const auto& test) { return std::string(name_of(test.param)); });

// A queue of 300 ms that is full makes every message late, and stays full.
TEST(Run, FivePercentTooMuchDoesNotMakeEveryMessageLate) {
  Choice choice{.peers = {Peer::kOurs}, .loads = {1.05, 2.0}, .length = 5s};
  int runs = 0;
  for (const Scenario& s : scenarios("rate", choice)) {
    if (s.queue < s.deadline) continue;
    const Row row = run(s);
    EXPECT_GT(row.of_possible, 0.9) << s.name << " " << s.load;
    EXPECT_LT(row.queue_p99_ms, 60) << s.name << " " << s.load;
    ++runs;
  }
  EXPECT_EQ(runs, 4);
}

// What a train of packets shows is the rate of the cell and not a vehicle's share of it.
TEST(Run, TenVehiclesThatWantMoreThanTheirCellHasShareIt) {
  for (const double load : {1.06, 2.0}) {
    Choice choice{.peers = {Peer::kOurs}, .loads = {load}, .length = 5s};
    for (const Scenario& s : scenarios("vehicles", choice)) {
      if (s.vehicles != 10) continue;
      const Row row = run(s);
      EXPECT_GT(row.of_possible, 0.85) << load;
      EXPECT_LT(row.queue_p99_ms, 100) << load;
      ASSERT_TRUE(row.jain.has_value());
      EXPECT_GT(*row.jain, 0.9) << load;
    }
  }
}

Row run_of_ten(double load, bool is_spread, Duration length) {
  const Choice choice{
      .peers = {Peer::kUdp}, .loads = {load}, .length = length, .is_spread = is_spread};
  for (const Scenario& s : scenarios("vehicles", choice)) {
    if (s.vehicles == 10) return run(s);
  }
  return {};
}

// Of what is offered below capacity nothing is missed, whenever a vehicle joins.
TEST(Run, VehiclesThatJoinLaterAreCountedFromThenOn) {
  const Row row = run_of_ten(0.5, true, 4s);
  EXPECT_EQ(row.missed, 0U);
  EXPECT_EQ(row.early_missed_percent, 0);
  EXPECT_EQ(row.later_missed_percent, 0);
  EXPECT_NEAR(row.of_possible, 1, 1e-9);
  EXPECT_GT(row.jain.value(), 0.999);
}

// UDP at twice the rate fills the queue for good: what is free before all have joined is no part of
// what was possible, and the cell is full in both parts of the run.
TEST(Run, TheTimeOfJoiningIsToldApartButUtilisationIsOfTheWholeRun) {
  const Row spread = run_of_ten(2, true, 4s);
  ASSERT_TRUE(spread.joining_queue_p99_ms.has_value());
  EXPECT_NEAR(*spread.joining_queue_p99_ms, 300, 5);
  EXPECT_NEAR(spread.queue_p99_ms, 300, 5);
  // Half of ten vehicles fill the cell; they are there after some 200 ms of 4.45 s.
  EXPECT_GT(spread.utilisation, 0.92);
  EXPECT_LT(spread.utilisation, 0.995);
  EXPECT_LT(spread.early_missed_percent.value(), spread.later_missed_percent.value());
  EXPECT_FALSE(run_of_ten(2, false, 4s).joining_queue_p99_ms.has_value());
}

TEST(Run, AShortRunHasNoLaterMessages) {
  const Row row = run_of_ten(0.5, false, 1s);
  EXPECT_EQ(row.early_missed_percent, 0);
  EXPECT_FALSE(row.later_missed_percent.has_value());
}

// Where the queue is not so long that everything in it is late.
TEST(Run, BesideOneFlowOfCubicAVehicleGetsItsShareAndLeavesTheRest) {
  Choice choice;
  choice.peers = {Peer::kOurs};
  choice.length = 8s;
  int runs = 0;
  for (const Scenario& s : scenarios("cubic", choice)) {
    if (s.load < 1 || (s.queue > s.deadline && !s.codel)) continue;
    const Row row = run(s);
    ASSERT_TRUE(row.cross_share && row.own_share) << s.name;
    EXPECT_GT(*row.own_share, 0.7) << s.name;
    EXPECT_GT(*row.cross_share, 0.4) << s.name;
    ++runs;
  }
  EXPECT_EQ(runs, 2);
}

TEST(Run, UdpAtTwiceTheRateLosesHalfOfItsPackets) {
  Scenario s =
      scenarios("vehicles", Choice{.peers = {Peer::kUdp}, .loads = {2.0}, .length = 5s}).front();
  // Messages of one datagram, so that each packet that is carried counts.
  s.message_bytes = 1400;
  s.period = Duration{s.capacity.transmit_time(1428).count() * std::int64_t(s.vehicles) / 2};
  s.queue = 30ms;
  const Row row = run(s);
  EXPECT_NEAR(static_cast<double>(row.missed) / static_cast<double>(row.messages), 0.5, 0.02);
}

TEST(Run, ALateVehicleIsSeenToGetItsShare) {
  // Far below capacity it has all that it offers at once, and its share is what it is entitled to.
  Choice choice;
  choice.peers = {Peer::kUdp};
  choice.length = 6s;
  Scenario s = scenarios("late", choice).front();
  s.load = 0.95;
  s.period = s.period * 200 / 95;
  const Row row = run(s);
  ASSERT_TRUE(row.share_after_ms.has_value());
  EXPECT_GT(*row.share_after_ms, 100);
  EXPECT_LT(*row.share_after_ms, 1000);
}

TEST(Run, TwoFlowsOfCubicShareABottleneck) {
  Choice choice;
  choice.peers = {Peer::kCubic};
  choice.length = 20s;
  for (const Scenario& s : scenarios("cubic", choice)) {
    const Row row = run(s);
    ASSERT_TRUE(row.cross_share && row.own_share) << s.name;
    // Only what is on time counts of the vehicle's payload.
    EXPECT_GT(*row.cross_share, 0.5) << s.name;
    EXPECT_LT(*row.cross_share + *row.own_share, 2.01) << s.name;
  }
}

}  // namespace
}  // namespace interneuron::load::run_test
