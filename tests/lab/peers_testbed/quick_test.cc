// The quick selection: it shows every condition, size and deadline, and takes less than 25 minutes.
#include "lab/peers_testbed/comparison.h"

#include <gtest/gtest.h>

#include <set>

namespace interneuron::peers_testbed::quick_test {
namespace {

using namespace std::chrono_literals;

TEST(Quick, ItTakesLessThanTwentyFiveMinutes) {
  Duration all{};
  for (const peers_testbed::Run& run : quick_runs(1)) all += time_of_run(run);
  EXPECT_LE(all, 25min);
  EXPECT_GT(all, 10min);
}

TEST(Quick, ItShowsSomethingOfEverything) {
  std::set<std::string_view> scenarios;
  std::set<std::string_view> peers;
  std::set<std::size_t> sizes;
  std::set<Duration> deadlines;
  for (const peers_testbed::Run& run : quick_runs(5)) {
    ASSERT_NE(run.scenario, nullptr);
    ASSERT_NE(run.peer, nullptr);
    scenarios.insert(run.scenario->name);
    peers.insert(run.peer->name);
    sizes.insert(run.message_bytes);
    deadlines.insert(run.deadlines.begin(), run.deadlines.end());
    EXPECT_EQ(run.seed, 5U);
    // The hole ends before the run does.
    EXPECT_GT(run.length() / 2, run.scenario->hole);
  }
  for (const char* name : {"clean", "loss", "bursts", "hole", "drive-5g-4g", "drive-lte-town"}) {
    EXPECT_TRUE(scenarios.contains(name)) << name;
  }
  for (const char* name : {"ours_coded", "ours_stripe", "ours_shadow", "ours_failover", "udp",
                           "udp_duplicate", "tcp_bbr", "mptcp", "srt_backup", "fastdds_tuned"}) {
    EXPECT_TRUE(peers.contains(name)) << name;
  }
  EXPECT_EQ(sizes, std::set<std::size_t>(kSizes.begin(), kSizes.end()));
  EXPECT_EQ(deadlines, std::set<Duration>(kDeadlines.begin(), kDeadlines.end()));
}

}  // namespace
}  // namespace interneuron::peers_testbed::quick_test
