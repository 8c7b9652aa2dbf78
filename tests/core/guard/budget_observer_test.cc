// GuardKind::kBudget at an observing node, in virtual time: rounds of the paper's pipeline with
// known delays, told of as headers tell.
#include "core/guard/observers.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <deque>

namespace interneuron::guard::budget_observer_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kDeadline = 130ms;
constexpr Duration kPeriod = 100ms;
constexpr std::uint8_t kRaw = 0;
constexpr std::uint8_t kSampled = 1;

std::vector<LevelProfile> ladder() {
  return {{8ms, 10ms, {0.14, 0.13}}, {19ms, 24ms, {0.35, 0.33}}, {44ms, 46ms, {0.40, 0.38}}};
}
constexpr std::size_t kTop = 2;

// What one round meets.
struct Met {
  Duration uplink = 40ms;
  Duration inside{};  // its computation takes so much longer
  double slow = 1.0;  // and so many times as long
  Duration downlink = 12ms;
  bool answered = true;
  // What the links say of the downlink when the computation begins.
  Duration ahead{};
};

// A roadside unit whose clock is ahead of the vehicle's by alpha; one round after the other, each
// told of in the next one's header.
class Road {
 public:
  explicit Road(Duration alpha = {}, Terms terms = {GuardKind::kBudget, 1.0, 0.14})
      : alpha_(alpha), terms_(terms) {}

  // The level chosen.
  std::size_t round(const Met& met) {
    const Duration t0 = round_ * kPeriod;
    const StageEnd up = end(1);
    const TimePoint start = at(t0 + met.uplink);
    Indicator states{};
    RecentE2e times{};
    for (std::size_t i = 0; i < outcomes_.size(); ++i) {
      times[i] = outcomes_[i];
      states[i] = *outcomes_[i] <= kDeadline ? RoundState::kOnTime : RoundState::kMissed;
    }
    budget.learn(start, RoundId{round_}, states, times);
    budget.note_arrival(start, up);
    budget.end_stage(start, up, std::nullopt);
    StageEnd begin = up;
    begin.ahead = met.ahead;
    last = budget.begin_computation(start, begin, {}, levels, kTop, {});
    const Duration takes = Duration{static_cast<std::int64_t>(
                               static_cast<double>(levels[last.level].median.count()) * met.slow)} +
                           met.inside;
    StageEnd computed = end(2);
    computed.is_computation = true;
    budget.end_stage(start + takes, computed, std::nullopt);
    e2e = met.uplink + takes + met.downlink;
    outcomes_.push_front(met.answered ? e2e : kNever);
    if (outcomes_.size() > kIndicatorRounds) outcomes_.pop_back();
    ++round_;
    return last.level;
  }
  std::size_t rounds(int count, const Met& met) {
    std::size_t level = 0;
    for (int i = 0; i < count; ++i) level = round(met);
    return level;
  }

  StageEnd end(std::size_t stage) const {
    StageEnd e;
    e.round = RoundId{round_};
    e.stage = stage;
    e.t0 = PeerTime{round_ * kPeriod};
    e.deadline = kDeadline;
    e.variant = variant;
    e.best_planned = kRaw;
    e.terms = terms_;
    return e;
  }
  TimePoint at(Duration world) const { return TimePoint{world + alpha_}; }
  Duration t0() const { return round_ * kPeriod; }

  BudgetObserver budget;
  std::vector<LevelProfile> levels = ladder();
  std::uint8_t variant = kRaw;
  LevelChoice last;
  Duration e2e{};

 private:
  Duration alpha_;
  Terms terms_;
  std::uint32_t round_ = 0;
  std::deque<E2e> outcomes_;
};

TEST(BudgetObserver, TakesTheHighestLevelThatIsOnTime) {
  Road road;
  EXPECT_EQ(road.rounds(100, {}), 2U);              // 96 ms
  EXPECT_EQ(road.rounds(1, {.uplink = 85ms}), 1U);  // 141 with the top level, 116 below
  EXPECT_EQ(road.rounds(1, {.uplink = 105ms}), 0U);
}

// A downlink that has become slow is made up for in the same round, not when its median has moved;
// and no sooner is it fast again than the level is back.
TEST(BudgetObserver, WhatTheLinksSayOfTheDownlinkCountsAtOnce) {
  Road road;
  EXPECT_EQ(road.rounds(100, {.ahead = 12ms}), 2U);
  EXPECT_EQ(road.round({.downlink = 52ms, .ahead = 52ms}), 1U);
  EXPECT_LE(road.e2e, kDeadline);
  EXPECT_EQ(road.round({.ahead = 12ms}), 2U);
}

// What they say too much or too little every time is learnt.
TEST(BudgetObserver, WhatTheLinksErrByIsLearnt) {
  Road road;
  EXPECT_EQ(road.rounds(100, {.downlink = 52ms, .ahead = 12ms}), 1U);
  Road other;
  EXPECT_EQ(other.rounds(100, {.ahead = 52ms}), 2U);
}

TEST(BudgetObserver, ANodeThatKnowsNothingFollowsTheApplication) {
  Road road;
  EXPECT_EQ(road.round({.uplink = 500ms}), kTop);
  EXPECT_FALSE(road.last.excess);
}

TEST(BudgetObserver, WhatTheRoundHadLostIsTold) {
  Road road;
  road.rounds(20, {});
  road.round({.uplink = 55ms});
  EXPECT_EQ(road.last.excess, 15ms);
}

// One delay per round, before or after the computation: a round that already lost time is not
// expected to lose more.
TEST(BudgetObserver, ARoundThatLostTimeBeforeIsNotExpectedToLoseMore) {
  Road road;
  const auto mixed = [&road](int i) {
    Met met;
    if (i % 4 == 0) met.uplink += 30ms;
    if (i % 4 == 2) met.downlink += 30ms;
    return road.round(met);
  };
  for (int i = 0; i < 400; ++i) mixed(i);
  // Not delayed so far: a quarter of the rounds is delayed later, the top level would be 126 ms.
  EXPECT_EQ(mixed(401), 2U);
  // Delayed by 30 ms before: 126 ms, were it delayed again 156 ms.
  EXPECT_EQ(mixed(400), 2U);
}

// Four milliseconds are a delay as well: rounds that have had one so short need no reserve, those
// that have had none do.
TEST(BudgetObserver, AShortDelayIsADelayToo) {
  Road road;
  for (int i = 0; i < 200; ++i) {
    road.round(i % 2 == 0 ? Met{.inside = 50ms} : Met{.uplink = 44ms});
  }
  EXPECT_EQ(road.round({.uplink = 44ms}), 2U);
  EXPECT_EQ(road.round({}), 1U);
}

TEST(BudgetObserver, WhatMayComeLaterIsLeftRoomFor) {
  Road road;
  for (int i = 0; i < 200; ++i) road.round({.downlink = i % 5 == 0 ? 62ms : 12ms});
  // With the top level every fifth round would take 146 ms, with the middle one 121 ms.
  EXPECT_EQ(road.rounds(1, {}), 1U);
}

TEST(BudgetObserver, ALevelRecovers) {
  Road road;
  road.rounds(50, {});
  for (int i = 0; i < 100; ++i) road.round({.downlink = 70ms});
  EXPECT_LT(road.rounds(1, {.downlink = 70ms}), 2U);
  EXPECT_EQ(road.rounds(600, {}), 2U);  // a minute later
}

// What slows all levels is learnt by whichever runs.
TEST(BudgetObserver, ASlowNodeIsLearntByOneLevelForAll) {
  Road road;
  road.rounds(50, {});
  // Twice as slow, the top level takes 88 ms: 140 ms in all.
  EXPECT_EQ(road.rounds(110, {.slow = 2.0}), 1U);
  EXPECT_EQ(road.rounds(600, {}), 2U);
}

TEST(BudgetObserver, ThePriceOfAMissDecidesWhereNoLevelIsSure) {
  const auto level_at = [](double price) {
    Road road({}, {GuardKind::kBudget, price, 0.14});
    // A tenth of the rounds is lost whatever is done, another tenth is saved by a lower level.
    for (int i = 0; i < 400; ++i) {
      road.round({.downlink = i % 10 == 0 ? 300ms : (i % 10 == 5 ? 50ms : 12ms)});
    }
    return road.rounds(1, {});
  };
  EXPECT_EQ(level_at(0.0), 2U);
  EXPECT_EQ(level_at(1.0), 1U);
}

TEST(BudgetObserver, RoundsThatAreNeverAnsweredCount) {
  Road road;
  road.rounds(100, {});
  for (int i = 0; i < 200; ++i) road.round({.answered = i % 3 != 0});
  EXPECT_LT(road.rounds(1, {}), 2U);
}

// Without raw copies that come, a sampled one is not held: the e2e time stays, where guard kPaper
// would let it creep (docs/paper.md, "Holds").
TEST(BudgetObserver, HoldsDoNotGrowWhenTheBetterVariantNeverComes) {
  Road road;
  road.variant = kSampled;
  for (int i = 0; i < 100; ++i) {
    StageEnd end = road.end(1);
    const TimePoint now = road.at(road.t0() + 60ms);
    road.budget.note_arrival(now, end);
    EXPECT_EQ(road.budget.hold(now, end, std::nullopt, false).until, now) << i;
    road.rounds(1, {.uplink = 60ms});
    EXPECT_LE(road.e2e, 116ms);
  }
}

// One round in which both variants come after these times and the computation begins after
// `begins`. How long after t0 the hold of the sampled one would end.
Duration held(Road& road, Duration raw, Duration sampled, Duration begins) {
  StageEnd end = road.end(1);
  end.variant = kSampled;
  const TimePoint now = road.at(road.t0() + sampled);
  road.budget.note_arrival(now, end);
  const Duration until = road.budget.hold(now, end, std::nullopt, false).until - road.at(road.t0());
  end.variant = kRaw;
  road.budget.note_arrival(road.at(road.t0() + raw), end);
  road.rounds(1, {.uplink = begins});
  return until;
}

TEST(BudgetObserver, HoldsForABetterVariantThatIsAboutToCome) {
  Road road;
  for (int i = 0; i < 100; ++i) held(road, 40ms, 30ms, 40ms);
  EXPECT_GE(held(road, 40ms, 35ms, 40ms), 40ms);
  EXPECT_LE(held(road, 40ms, 35ms, 40ms), 45ms);
  EXPECT_EQ(held(road, 40ms, 60ms, 40ms), 60ms);  // it never came that late
}

// Until the median, every second round would go on with the smaller one.
TEST(BudgetObserver, HoldsUntilMostOfTheBetterOnesHaveCome) {
  Road road;
  const auto raw = [](int i) { return 36ms + i % 16 * 1ms; };
  for (int i = 0; i < 112; ++i) held(road, raw(i), 35ms, raw(i));
  EXPECT_GE(held(road, 40ms, 35ms, 40ms), 49ms);
  EXPECT_LE(held(road, 40ms, 35ms, 40ms), 53ms);
}

TEST(LastValues, QuantilesRoundUpAndAKeyWithoutValuesHasThoseOfAll) {
  VeryRecent values;
  EXPECT_EQ(values.quantile(TimePoint{}, 0, 7), std::nullopt);
  for (int i = 1; i <= 9; ++i) {
    values.add(TimePoint{}, 0, i);
    EXPECT_EQ(values.median(TimePoint{}, 0), (i + 1) / 2);  // the lower of two
    EXPECT_EQ(values.quantile(TimePoint{}, 0, 7), (7 * i + 7) / 8);
    EXPECT_EQ(values.quantile(TimePoint{}, 0, 8), i);
  }
  EXPECT_EQ(values.quantile(TimePoint{}, 1, 7), 8);
  values.add(TimePoint{}, 1, 100);
  EXPECT_EQ(values.quantile(TimePoint{}, 1, 7), 100);
  EXPECT_EQ(values.median(TimePoint{}, 2), std::nullopt);
}

// What comes after the deadline is not waited for, what usually comes before it is.
TEST(BudgetObserver, HoldsForTheManyWhereAFewComeTooLate) {
  Road road;
  for (int i = 0; i < 100; ++i) held(road, i % 5 == 0 ? 200ms : 40ms, 35ms, 40ms);
  EXPECT_GE(held(road, 40ms, 35ms, 40ms), 40ms);
  EXPECT_LE(held(road, 40ms, 35ms, 40ms), 45ms);
}

TEST(BudgetObserver, AClockStepCostsTheReferencesNotTheLaw) {
  Road road;
  for (int i = 0; i < 200; ++i) road.round({.downlink = i % 5 == 0 ? 62ms : 12ms});
  ASSERT_EQ(road.rounds(1, {}), 1U);
  road.budget.reset();
  EXPECT_EQ(road.rounds(3, {}), 1U);  // what it chose last, then what the law says
}

// θ contains the offset, R its negative: decisions are bit-identical.
RC_GTEST_PROP(BudgetObserver, DecisionsAreInvariantToTheClockOffset, ()) {
  const Duration alpha = *rc::gen::element<Duration>(1h, -1h, 24h, -24h, 1ns, -7ms);
  Road plain;
  Road moved(alpha);
  for (int i = 0; i < 150; ++i) {
    const auto ms = [](int low, int high) {
      return Duration{*rc::gen::inRange<std::int64_t>(low * 1'000'000, high * 1'000'000)};
    };
    Met met{ms(30, 80), ms(0, 20), 1.0, ms(10, 40), *rc::gen::inRange(0, 20) != 0};
    for (Road* road : {&plain, &moved}) {
      StageEnd end = road->end(1);
      end.variant = kSampled;
      const TimePoint now = road->at(road->t0() + 25ms);
      road->budget.note_arrival(now, end);
      const auto hold = road->budget.hold(now, end, std::nullopt, false);
      road->last.excess = hold.until - now;
    }
    RC_ASSERT(plain.last.excess == moved.last.excess);
    RC_ASSERT(plain.round(met) == moved.round(met));
    RC_ASSERT(plain.last.excess == moved.last.excess);
  }
}

// Anything a peer may send is survived.
RC_GTEST_PROP(BudgetObserver, AnyBytesAreSurvived, ()) {
  BudgetObserver budget;
  const auto levels = ladder();
  for (int i = 0; i < 60; ++i) {
    StageEnd end;
    end.round = RoundId{*rc::gen::arbitrary<std::uint32_t>()};
    end.stage = *rc::gen::inRange<std::size_t>(1, kMaxStages + 1);
    end.t0 = PeerTime{Duration{*rc::gen::arbitrary<std::int64_t>()}};
    end.deadline = Duration{*rc::gen::inRange<std::int64_t>(1000, 4'000'000'000'000)};
    end.variant = *rc::gen::inRange<std::uint8_t>(0, kMaxVariants);
    end.degraded = *rc::gen::arbitrary<bool>();
    end.is_computation = *rc::gen::arbitrary<bool>();
    end.terms.kind = GuardKind::kBudget;
    const TimePoint now{Duration{*rc::gen::inRange<std::int64_t>(0, 1'000'000'000'000)}};
    budget.settle(now, end.round, *rc::gen::element(RoundState::kOnTime, RoundState::kMissed),
                  *rc::gen::element<E2e>(E2e{}, E2e{kNever}, E2e{50ms}));
    budget.note_arrival(now, end);
    budget.hold(now, end, std::nullopt, *rc::gen::arbitrary<bool>());
    if (!end.is_computation) budget.begin_computation(now, end, {}, levels, kTop, {});
    budget.end_stage(now, end, std::nullopt);
    budget.settle(now, end.round, RoundState::kMissed, E2e{70ms});
  }
}

}  // namespace
}  // namespace interneuron::guard::budget_observer_test
