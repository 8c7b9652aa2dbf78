// The figures that follow from what the programs of a run leave.
#include "lab/peers_testbed/comparison.h"

#include <gtest/gtest.h>

namespace interneuron::peers_testbed::figures_test {
namespace {

using namespace std::chrono_literals;

Run run_of(const char* peer, std::vector<Duration> deadlines) {
  return {scenario_of("clean"), peer_of(peer), 1000, 4, std::move(deadlines), 7};
}

// Four messages, one every 100 ms.
transports::VehiclesRecord four() {
  const TimePoint begin{10s};
  return {{{begin, begin + 100ms, begin + 200ms, begin + 300ms}}, 2ms, 4400};
}

TEST(Figures, MissesAreCountedAtEachDeadline) {
  const TimePoint begin{10s};
  // Ages of 40, 120 and 250 ms; the third message never comes.
  const transports::RoadRecord road{
      {{0, 0, 0, begin + 40ms}, {0, 1, 0, begin + 220ms}, {0, 3, 0, begin + 550ms}}, 0.02};
  const auto rows = rows_of(run_of("udp", {100ms, 150ms, 300ms}), four(), road);
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0].missed, 3U);
  EXPECT_EQ(rows[1].missed, 2U);
  EXPECT_EQ(rows[2].missed, 1U);
  EXPECT_EQ(rows[2].deadline, 300ms);
  EXPECT_EQ(rows[0].missed_numbers, (std::vector<std::size_t>{1, 2, 3}));
  EXPECT_EQ(rows[2].missed_numbers, std::vector<std::size_t>{2});
  for (const Row& row : rows) {
    EXPECT_EQ(row.messages, 4U);
    EXPECT_EQ(row.degraded, 0U);
    EXPECT_EQ(row.seed, 7U);
    EXPECT_DOUBLE_EQ(row.wire_ratio, 1.1);
    EXPECT_DOUBLE_EQ(row.cpu_us_send, 500);
    // A fiftieth of a processor, for 100 ms each.
    EXPECT_DOUBLE_EQ(row.cpu_us_receive.value(), 2000);
  }
}

TEST(Figures, AgesAreThoseOfAllMessages) {
  const TimePoint begin{10s};
  transports::RoadRecord road{
      {{0, 0, 0, begin + 40ms}, {0, 1, 0, begin + 220ms}, {0, 3, 0, begin + 550ms}}, 0.02};
  auto rows = rows_of(run_of("udp", {100ms}), four(), road);
  // The second of four, by age; the last of them never came.
  EXPECT_EQ(rows[0].p50_ms, 120);
  EXPECT_EQ(rows[0].p99_ms, std::nullopt);
  road.arrivals.push_back({0, 2, 0, begin + 900ms});
  rows = rows_of(run_of("udp", {100ms}), four(), road);
  EXPECT_EQ(rows[0].p99_ms, 700);
}

TEST(Figures, ASmallerVariantInTimeIsDegradedAndNotMissed) {
  const TimePoint begin{10s};
  // The first message came small and then whole, the second small but late, the third whole.
  const transports::RoadRecord road{{{0, 0, 1, begin + 30ms},
                                     {0, 0, 0, begin + 40ms},
                                     {0, 2, 0, begin + 250ms},
                                     {0, 1, 1, begin + 300ms}},
                                    0};
  const auto rows = rows_of(run_of("ours_down_sampling", {100ms}), four(), road);
  EXPECT_EQ(rows[0].degraded, 1U);
  EXPECT_EQ(rows[0].missed, 2U);
}

TEST(Figures, NothingArrivesAndNothingIsHandedOver) {
  auto rows = rows_of(run_of("udp", {100ms}), four(), {});
  EXPECT_EQ(rows[0].missed, 4U);
  EXPECT_EQ(rows[0].p50_ms, std::nullopt);
  EXPECT_EQ(rows[0].cpu_us_receive, std::nullopt);
  // Arrivals of messages that are none.
  rows = rows_of(run_of("udp", {100ms}), {}, {{{0, 5, 0, TimePoint{1s}}}, 0});
  EXPECT_EQ(rows[0].messages, 0U);
  EXPECT_EQ(rows[0].missed, 0U);
  EXPECT_EQ(rows[0].p50_ms, std::nullopt);
}

}  // namespace
}  // namespace interneuron::peers_testbed::figures_test
