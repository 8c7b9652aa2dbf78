// Runs under load, short ones: what any transport does below capacity, and that a run is the same
// every time.
#include "lab/load/run.h"

#include <gtest/gtest.h>

namespace interneuron::load {
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

TEST(Run, ADipIsSeenInTheFiguresOfTheBottleneck) {
  const Row row = run_first("dip", Peer::kOurs, 0, 12s);
  // 3 s at a tenth of the rate, into which twice as much is offered.
  EXPECT_GT(row.missed, 20U);
  EXPECT_GT(row.queue_p99_ms, 100);
  ASSERT_TRUE(row.whole_after_ms.has_value());
  EXPECT_GE(*row.whole_after_ms, 0);
}

}  // namespace
}  // namespace interneuron::load
