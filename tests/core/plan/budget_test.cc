#include "core/plan/budget.h"

#include <gtest/gtest.h>

#include "interneuron/sizes.h"

namespace interneuron::budget_test {
namespace {

using plan::compute_budget;
using plan::forecast_answers;
using plan::soonest_way;

using namespace std::chrono_literals;

LinkState link(bool up, Duration rtt, double mbit) {
  return LinkState{.up = up, .rtt_p50 = rtt, .rate = DataRate::mbit(mbit)};
}

constexpr std::size_t kBytesUp = 1000 * kMaxPieceBytes - 100'000;

TEST(ComputeBudget, IsTheDeadlineLessTheTransfersAndTheReserve) {
  // What fills 1,000 packets up and down is 1,428 kB on the wire: 14.28 ms at 800 Mbit/s; round
  // trip 20 ms; reserve 5 ms.
  const LinkState links[] = {link(true, 20ms, 800)};
  EXPECT_NEAR(to_ms(compute_budget(130ms, links, kBytesUp, 100'000)), 90.72, 0.01);
}

TEST(ComputeBudget, TakesTheSoonestLinkThatIsMeasured) {
  const LinkState links[] = {link(true, 20ms, 80), link(true, 30ms, 800), link(false, 1ms, 8000),
                             link(true, 0ms, 8000), link(true, 1ms, 0)};
  EXPECT_NEAR(to_ms(compute_budget(130ms, links, kBytesUp, 100'000)), 80.72, 0.01);
}

TEST(SoonestWay, IsHalfOfTheLeastRoundTripAndTheQueueOfNow) {
  LinkState queued = link(true, 80ms, 100);
  queued.rtt_min = 20ms;
  queued.queue_up = 30ms;
  LinkState longer = link(true, 90ms, 100);
  longer.rtt_min = 90ms;
  LinkState down = link(false, 2ms, 100);
  down.rtt_min = 2ms;
  EXPECT_EQ(soonest_way(std::array{queued, longer, down, link(true, 1ms, 100)}), 40ms);
  queued.queue_up = 60ms;
  EXPECT_EQ(soonest_way(std::array{queued, longer}), 45ms);
  EXPECT_EQ(soonest_way(std::array{down}), 0ms);
  EXPECT_EQ(soonest_way({}), 0ms);
}

// A queue counts once: in the median of the round trips it is contained already.
TEST(ForecastAnswers, AreMadeOfTheLeastRoundTripAndTheQueues) {
  LinkState a = link(true, 80ms, 80);
  a.id = LinkId{0};
  a.rtt_min = 20ms;
  a.queue_up = 30ms;
  a.queue_down = 25ms;
  const std::size_t bytes[] = {100 * kMaxPieceBytes};
  Plan plan;
  plan.sends.push_back({0, a.id});
  const auto answers = forecast_answers(plan, {{}, bytes, {}}, {&a, 1});
  ASSERT_TRUE(answers[0]);
  EXPECT_NEAR(to_ms(*answers[0]),
              30 + 10 + to_ms(a.usable_rate().transmit_time(wire_size(bytes[0]))) + 25 + 10, 0.01);
  EXPECT_FALSE(answers[1]);
}

TEST(ComputeBudget, IsZeroWhenNothingCanBePromised) {
  EXPECT_EQ(compute_budget(130ms, {}, 1000, 1000), 0ms);
  const LinkState slow[] = {link(true, 200ms, 100)};
  EXPECT_EQ(compute_budget(130ms, slow, 1000, 1000), 0ms);
}

}  // namespace
}  // namespace interneuron::budget_test
