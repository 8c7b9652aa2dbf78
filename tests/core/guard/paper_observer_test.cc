#include "core/guard/observers.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::guard::paper_observer_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kDeadline = 130ms;

// A stage whose clock is ahead of the origin's by alpha; world time 0 is t0 = 0 of round 0.
struct Stage {
  explicit Stage(std::int64_t true_alpha = 0) : alpha(true_alpha) {}
  std::int64_t alpha;
  PaperObserver observer;

  TimePoint at(Duration world) const { return TimePoint{Duration{world.count() + alpha}}; }
  ClockView clock() const { return {alpha, 20ms}; }
  static StageEnd end(std::uint32_t round, Duration t0, std::int16_t x) {
    return {RoundId{round}, 1, PeerTime{t0}, x, kDeadline};
  }
  void learn_base(Duration theta) {
    observer.end_stage(at(theta), end(0, 0ms, 0), clock());
    observer.settle(at(theta), RoundId{0}, RoundState::kOnTime);
  }
};

TEST(Observer, WithoutABaseNothingIsLateUnlessARoundWasMissed) {
  Stage s;
  EXPECT_EQ(s.observer.end_stage(s.at(500ms), Stage::end(0, 0ms, 0), s.clock()), Verdict{});
  const Verdict v = s.observer.end_stage(s.at(501ms), Stage::end(1, 0ms, -1), s.clock());
  EXPECT_TRUE(v.late);
  EXPECT_EQ(v.overrun, kFullSeverity);
}

TEST(Observer, TheIndicatorAppliesEachHistoryOnceOldestFirst) {
  Stage s;
  s.observer.end_stage(s.at(100ms), Stage::end(0, 0ms, 0), s.clock());
  s.observer.end_stage(s.at(50ms), Stage::end(1, 0ms, 0), s.clock());
  Indicator known{};
  known[0] = RoundState::kOnTime;  // round 1
  known[1] = RoundState::kOnTime;  // round 0
  for (int i = 0; i < 2; ++i) {
    s.observer.learn(s.at(200ms), RoundId{2}, known, {});
    // 100, then 50 folded in; the other order would give 85.
    EXPECT_EQ(s.observer.base(s.at(200ms), 1), 65ms);
  }
}

TEST(Observer, TheIndicatorOfTheFirstRoundsNamesNobody) {
  Stage s;
  Indicator all;
  all.fill(RoundState::kOnTime);
  s.observer.end_stage(s.at(1ms), Stage::end(0, 0ms, 0), s.clock());
  s.observer.learn(s.at(2ms), RoundId{0}, all, {});
  EXPECT_FALSE(s.observer.base(s.at(2ms), 1));
  s.observer.learn(s.at(2ms), RoundId{1}, all, {});
  EXPECT_EQ(s.observer.base(s.at(2ms), 1), 1ms);
}

TEST(Observer, AClockThatIsNotKnownMeansNoBase) {
  Stage s;
  s.learn_base(50ms);
  EXPECT_FALSE(s.observer.stage_deadline(s.at(60ms), Stage::end(1, 0ms, 200), std::nullopt));
}

TEST(Observer, LateMeansBeyondBasePlusXTimesBase) {
  Stage s(3'600'000'000'007);
  s.learn_base(50ms);
  const auto x20 = Stage::end(1, 100ms, 200);  // D1 = 60 ms
  EXPECT_FALSE(s.observer.end_stage(s.at(160ms), x20, s.clock()).late);
  const Verdict v = s.observer.end_stage(s.at(160ms + 1ns), x20, s.clock());
  EXPECT_TRUE(v.late);
  EXPECT_EQ(v.overrun, 1ns);
}

TEST(Observer, XOfMinusOneIsAlwaysLate) {
  Stage s;
  s.learn_base(50ms);
  EXPECT_TRUE(
      s.observer.end_stage(s.at(100ms + 10ms), Stage::end(1, 100ms, -1000), s.clock()).late);
}

TEST(Observer, TheTrueElapsedTimeIsClampedToHalfARoundTripAndTheDeadline) {
  Stage s;
  s.learn_base(2ms);  // less than half the round trip: the clock estimate must be off
  EXPECT_EQ(s.observer.stage_deadline(s.at(10ms), Stage::end(1, 0ms, 1000), s.clock()), 12ms);
  Stage slow;
  slow.learn_base(500ms);
  EXPECT_EQ(slow.observer.stage_deadline(slow.at(1s), Stage::end(1, 0ms, 100), slow.clock()),
            500ms + 13ms);
}

TEST(Observer, HoldsUntilTheStageDeadlineOnItsOwnClock) {
  Stage s(-7'000'000);
  s.learn_base(50ms);
  const auto hold = s.observer.hold(s.at(140ms), Stage::end(1, 100ms, 200), s.clock(), false);
  EXPECT_TRUE(hold.is_stage_deadline);
  EXPECT_EQ(hold.until, s.at(160ms));
  const Verdict v = s.observer.end_stage_held(Stage::end(1, 100ms, 200), hold);
  EXPECT_FALSE(v.late);
  EXPECT_TRUE(v.released_at_deadline);
  s.observer.settle(hold.until, RoundId{1}, RoundState::kOnTime);
  EXPECT_EQ(s.observer.base(hold.until, 1), Duration{s.alpha} + smoothed(50ms, 60ms));
}

TEST(Observer, WithoutABaseItHoldsForAQuarterOfTheDeadline) {
  Stage s;
  const auto hold = s.observer.hold(s.at(40ms), Stage::end(0, 0ms, 0), s.clock(), false);
  EXPECT_EQ(hold.until, s.at(40ms) + kDeadline / 4);
  EXPECT_FALSE(hold.is_stage_deadline);
  EXPECT_EQ(s.observer.end_stage_held(Stage::end(0, 0ms, 0), hold), Verdict{});
  // A round was missed before there was a reference: late at full severity, held or not.
  EXPECT_EQ(s.observer.end_stage_held(Stage::end(0, 0ms, -1), hold).overrun, kFullSeverity);
}

TEST(Observer, TheLastStageAtTheOriginHoldsUntilTheEndToEndDeadlineAtMost) {
  PaperObserver origin(true);
  origin.end_stage(TimePoint{120ms}, Stage::end(0, 0ms, 0), std::nullopt);
  origin.settle(TimePoint{120ms}, RoundId{0}, RoundState::kOnTime);
  const auto hold = origin.hold(TimePoint{200ms}, Stage::end(1, 100ms, 500), std::nullopt, true);
  EXPECT_EQ(hold.until, TimePoint{230ms});
}

const std::vector<LevelProfile> kLadder{{5ms, 6ms, {}}, {20ms, 22ms, {}}, {45ms, 48ms, {}}};

// The hand-over was in time, but then the message waited: what passed since counts.
TEST(Observer, JudgesAgainWhenTheComputationBegins) {
  for (const bool again : {true, false}) {
    PaperObserver road(false, {.judge_at_start = again});
    const ClockView clock{.alpha = 0, .rtt_min = 10ms};
    road.end_stage(TimePoint{50ms}, Stage::end(0, 0ms, 0), clock);
    road.settle(TimePoint{120ms}, RoundId{0}, RoundState::kOnTime);
    const StageEnd end = Stage::end(1, 100ms, 0);
    const Verdict verdict = road.end_stage(TimePoint{145ms}, end, clock);
    ASSERT_FALSE(verdict.late);
    const auto level = [&](Duration at) {
      return road.begin_computation(TimePoint{at}, end, clock, kLadder, 2, verdict).level;
    };
    EXPECT_EQ(level(145ms), 2U);
    // A turn of a loop is no delay.
    EXPECT_EQ(level(150ms + PaperObserver::kTurn), 2U);
    EXPECT_EQ(level(160ms), again ? 1U : 2U);
    EXPECT_EQ(level(185ms), again ? 0U : 2U);
  }
}

TEST(Observer, WithoutRoundsBelowZeroTheBaseStays) {
  for (const bool learns : {true, false}) {
    PaperObserver road(false, {.learn_below_zero = learns});
    std::uint32_t round = 0;
    const auto on_time = [&](Duration theta, std::int16_t x) {
      const Duration t0 = round * 100ms;
      road.end_stage(TimePoint{t0 + theta}, Stage::end(round, t0, x), std::nullopt);
      road.settle(TimePoint{t0 + 130ms}, RoundId{round++}, RoundState::kOnTime);
    };
    on_time(50ms, 100);
    on_time(20ms, -200);
    EXPECT_EQ(road.base(TimePoint{1s}, 1), learns ? 29ms : 50ms);
    on_time(60ms, 0);
    EXPECT_GT(road.base(TimePoint{1s}, 1), learns ? 29ms : 50ms);
  }
}

// A constant offset of the clocks moves θ, base, α̂ and D alike; every decision stays bit-identical.
RC_GTEST_PROP(Observer, DecisionsAreInvariantToTheClockOffset, ()) {
  const auto alpha = *rc::gen::inRange<std::int64_t>(-90'000'000'000'000, 90'000'000'000'000);
  Stage plain;
  Stage moved(alpha);
  for (std::uint32_t round = 0; round < 60; ++round) {
    const Duration t0 = round * 100ms;
    const Duration theta{*rc::gen::inRange<std::int64_t>(1'000'000, 200'000'000)};
    const auto x = *rc::gen::inRange<std::int16_t>(-1000, 1000);
    const auto state = *rc::gen::element(RoundState::kOnTime, RoundState::kMissed);
    Verdict verdicts[2];
    PaperObserver::Hold holds[2];
    std::size_t levels[2];
    const Duration waited{*rc::gen::inRange<std::int64_t>(0, 100'000'000)};
    int i = 0;
    for (Stage* s : {&plain, &moved}) {
      holds[i] = s->observer.hold(s->at(t0 + theta), Stage::end(round, t0, x), s->clock(), false);
      verdicts[i] = s->observer.end_stage(s->at(t0 + theta), Stage::end(round, t0, x), s->clock());
      levels[i] = s->observer
                      .begin_computation(s->at(t0 + theta + waited), Stage::end(round, t0, x),
                                         s->clock(), kLadder, 2, verdicts[i])
                      .level;
      s->observer.settle(s->at(t0 + theta), RoundId{round}, state);
      ++i;
    }
    RC_ASSERT(verdicts[0] == verdicts[1]);
    RC_ASSERT(levels[0] == levels[1]);
    RC_ASSERT(holds[0].until + Duration{alpha} == holds[1].until);
  }
}

// Drift ρ moves θn - Dn by at most ρ·(10 s + 3 periods) (docs/paper.md, "Stage deadlines"). Clock
// estimates come from exchanges every 50 ms, as in production; outcomes are given, so that a
// decision that differs does not change what follows.
RC_GTEST_PROP(Observer, DriftChangesDecisionsOnlyWithinItsBound, ()) {
  constexpr std::int64_t kPpm = 100;
  constexpr Duration kPeriod = 100ms;
  constexpr Duration kBound{(10'000'000'000 + 3 * 100'000'000) * kPpm / 1'000'000};
  const auto drifted = [](Duration t) {
    return TimePoint{Duration{t.count() + t.count() * kPpm / 1'000'000}};
  };
  struct Host {
    PaperObserver observer;
    ClockOffset clock;
  } plain, drifting;
  Duration next_exchange{};
  for (std::uint32_t round = 0; round < 300; ++round) {
    const Duration t0 = round * kPeriod;
    const Duration theta{*rc::gen::inRange<std::int64_t>(20'000'000, 120'000'000)};
    for (; next_exchange <= t0; next_exchange += 50ms) {
      const Duration there = 11ms;
      const Duration back{*rc::gen::inRange<std::int64_t>(11'000'000, 40'000'000)};
      const PeerTime u{next_exchange};
      // This host sent at `next_exchange - there`; the origin answered at once.
      const Duration sent = next_exchange - there;
      const Duration received = next_exchange + back;
      if (sent < 0ns) continue;
      plain.clock.add(TimePoint{received}, u, TimePoint{sent}, 0ns);
      drifting.clock.add(drifted(received), u, drifted(sent), 0ns);
    }
    const Duration now = t0 + theta;
    const auto x = *rc::gen::inRange<std::int16_t>(-1000, 1000);
    const StageEnd end{RoundId{round}, 1, PeerTime{t0}, x, kDeadline};
    const auto clock = plain.clock.view(TimePoint{now});
    const auto dn = plain.observer.stage_deadline(TimePoint{now}, end, clock);
    const Verdict a = plain.observer.end_stage(TimePoint{now}, end, clock);
    const Verdict b =
        drifting.observer.end_stage(drifted(now), end, drifting.clock.view(drifted(now)));
    const auto state = *rc::gen::element(RoundState::kOnTime, RoundState::kMissed);
    plain.observer.settle(TimePoint{now}, RoundId{round}, state);
    drifting.observer.settle(drifted(now), RoundId{round}, state);
    if (dn && std::abs((theta - *dn).count()) > kBound.count()) RC_ASSERT(a.late == b.late);
  }
}

}  // namespace
}  // namespace interneuron::guard::paper_observer_test
