// Beside a CUBIC flow that keeps a long queue full, a camera that asks for half of its fair share
// and whose messages may stand behind that queue: it gets what it asks for, and the flow has what
// is left.
#include <gtest/gtest.h>

#include "lab/load/run.h"

namespace interneuron::load::beside_cubic_test {
namespace {

using namespace std::chrono_literals;

// Half a minute: in the first few seconds it is found out that the flow gives way to nobody.
Row beside(double mbit, Duration queue, Duration deadline, std::uint64_t seed, Peer peer,
           double asks_for = 0.5, std::size_t flows = 1) {
  Choice choice;
  choice.peers = {peer};
  choice.length = 30s;
  choice.seed = seed;
  choice.is_encrypted = true;
  Scenario s = scenarios("cubic", choice).front();
  s.capacity = DataRate::mbit(mbit);
  s.queue = queue;
  s.deadline = deadline;
  s.period = 100ms;
  s.cross_flows = flows;
  s.load = asks_for / static_cast<double>(1 + flows);
  const double bytes = mbit * 1e6 / 8 * s.load * to_seconds(s.period);
  s.message_bytes = static_cast<std::size_t>(bytes * payload_share(65536));
  s.small_bytes = s.message_bytes / 4;
  return run(s);
}

double missed(const Row& row) {
  return static_cast<double>(row.missed) / static_cast<double>(row.messages);
}

class BesideCubic : public testing::TestWithParam<std::tuple<double, Duration>> {};

TEST_P(BesideCubic, WhatMayStandBehindTheQueueArrives) {
  const auto [mbit, queue] = GetParam();
  for (const std::uint64_t seed : {1U, 2U}) {
    const Row row = beside(mbit, queue, 2 * queue, seed, Peer::kOurs);
    // 3 s of 30 while the flow is not known, and 5 %.
    EXPECT_LT(missed(row), 0.15) << seed;
    EXPECT_GT(*row.cross_share, 0.5) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Queues, BesideCubic,
                         testing::Combine(testing::Values(10, 20, 60),
                                          testing::Values<Duration>(100ms, 300ms)));

TEST(BesideCubic, AVariantArrivesWhereTheQueueLeavesLittleTime) {
  const Row row = beside(20, 100ms, 150ms, 1, Peer::kOursVariants, 0.56);
  EXPECT_LT(missed(row), 0.2);
  EXPECT_GT(*row.cross_share, 0.5);
}

TEST(BesideCubic, TwoFlowsKeepTheirSharesToo) {
  const Row row = beside(20, 200ms, 400ms, 1, Peer::kOurs, 0.5, 2);
  EXPECT_LT(missed(row), 0.15);
  EXPECT_GT(*row.cross_share, 0.5);
}

TEST(BesideCubic, WhoAsksForFarMoreIsNoBully) {
  for (const Duration queue : {100ms, 300ms}) {
    const Row row = beside(20, queue, 2 * queue, 1, Peer::kOursVariants, 4);
    EXPECT_GT(*row.cross_share, 0.5);
  }
}

}  // namespace
}  // namespace interneuron::load::beside_cubic_test
