#include "core/guard/residual_law.h"

#include <gtest/gtest.h>

#include <vector>

namespace interneuron::guard::residual_law_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kStep = 100ms;

// 0 to 39 ms, different in each round.
Duration lost(std::uint32_t round) { return std::chrono::milliseconds(round * 2654435761U % 40U); }

// Rounds every 100 ms whose rest takes 20 ms and what they lost.
class Rounds {
 public:
  explicit Rounds(Duration offset = {}, std::int64_t drift_ppm = 0)
      : offset_(offset), drift_ppm_(drift_ppm) {}

  void run(int count) {
    for (int i = 0; i < count; ++i) {
      ResidualLaw::Sample s = next();
      s.rest = Duration{wrapping_add((20ms + lost(s.round.value)).count(), offset().count())};
      law.add(now_, s);
    }
  }
  // A sample of the next round, without its rest.
  ResidualLaw::Sample next() {
    now_ += kStep;
    return ResidualLaw::Sample{.round = RoundId{++round_}, .before = lost(round_ + 7) / 2};
  }
  Duration offset() const {
    return offset_ + Duration{now_.time_since_epoch().count() / 1'000'000 * drift_ppm_};
  }
  TimePoint now() const { return now_; }

  ResidualLaw law;

 private:
  Duration offset_;
  std::int64_t drift_ppm_;
  TimePoint now_{};
  std::uint32_t round_ = 0;
};

// The probability that a round loses at most so many milliseconds, by slack from -10 to 60 ms.
std::vector<double> law_of(const ResidualLaw& law, std::optional<Duration> before = std::nullopt) {
  std::vector<double> out;
  const ResidualLaw::Near near = law.near(before, 3ms);
  for (int slack = -10; slack <= 60; ++slack) out.push_back(near.within(slack * 1ms));
  return out;
}

TEST(ResidualLaw, AConstantOffsetLeavesEveryBitAsItIs) {
  Rounds plain;
  plain.run(700);
  for (const Duration offset :
       {Duration{1h}, Duration{-1h}, Duration{24h}, Duration::max() - 1s, Duration::min() + 1s}) {
    Rounds shifted(offset);
    shifted.run(700);
    EXPECT_EQ(law_of(shifted.law), law_of(plain.law));
    EXPECT_EQ(law_of(shifted.law, 5ms), law_of(plain.law, 5ms));
    EXPECT_EQ(wrapping_sub(shifted.law.base(shifted.now(), 0)->count(), offset.count()),
              plain.law.base(plain.now(), 0)->count());
  }
}

// 10 ms in 50 s, of which the median of 6.4 s sees half of what comes together in that time.
TEST(ResidualLaw, DriftAddsUpForTenSecondsOnly) {
  Rounds still;
  Rounds drifting({}, 200);
  still.run(500);
  drifting.run(500);
  EXPECT_EQ(drifting.offset(), 10ms);
  const auto in_still = still.law.near(std::nullopt, {});
  const auto in_drifting = drifting.law.near(std::nullopt, {});
  for (int slack = -10; slack <= 60; ++slack) {
    EXPECT_GE(in_drifting.within(slack * 1ms), in_still.within((slack - 2) * 1ms)) << slack;
    EXPECT_LE(in_drifting.within(slack * 1ms), in_still.within((slack + 2) * 1ms)) << slack;
  }
}

TEST(ResidualLaw, ABaseIsTheMedianOfTenSeconds) {
  Rounds r;
  EXPECT_FALSE(r.law.base(r.now(), 0));
  for (const int ms : {30, 20, 900}) {
    ResidualLaw::Sample s = r.next();
    s.rest = ms * 1ms;
    r.law.add(r.now(), s);
  }
  ResidualLaw::Sample other = r.next();
  other.key = 1;
  other.rest = 10ms;
  r.law.add(r.now(), other);
  EXPECT_EQ(r.law.base(r.now(), 0), 30ms);
  EXPECT_EQ(r.law.base(r.now(), 1), 10ms);
  EXPECT_EQ(r.law.base(r.now(), std::nullopt), 20ms);
  EXPECT_EQ(r.law.base(r.now() + 9s, 0), 30ms);
  EXPECT_FALSE(r.law.base(r.now() + 10s + 1ns, 0));
}

TEST(ResidualLaw, AClockStepCostsTheBasesNotTheLaw) {
  Rounds r;
  r.run(300);
  const auto before = law_of(r.law);
  r.law.drop_bases();
  EXPECT_EQ(law_of(r.law), before);
  EXPECT_FALSE(r.law.base(r.now(), 0));
  // What comes after the step has a base of its own, against which it has lost nothing.
  ResidualLaw::Sample s = r.next();
  s.rest = 20ms + 5s;
  r.law.add(r.now(), s);
  EXPECT_EQ(r.law.base(r.now(), 0), 20ms + 5s);
  EXPECT_GT(r.law.near(std::nullopt, {}).within(1ms), before[11]);
}

TEST(ResidualLaw, WhatIsToldAgainReplacesWhatWasKnown) {
  Rounds r;
  ResidualLaw::Sample s = r.next();
  s.answered = false;
  s.rest = 40ms;
  r.law.add(r.now(), s);
  EXPECT_FALSE(r.law.base(r.now(), 0));
  EXPECT_LT(r.law.near(std::nullopt, {}).within(30ms), 0.5);
  s.answered = true;
  s.rest = 70ms;
  r.law.add(r.now(), s);
  EXPECT_EQ(r.law.base(r.now(), 0), 70ms);
  EXPECT_GT(r.law.near(std::nullopt, {}).within(30ms), 0.5);
}

// A hundred rounds that lost 50 ms, and as many as the law holds that lost nothing.
TEST(ResidualLaw, KeepsTheLastRoundsOnly) {
  Rounds r;
  for (std::size_t i = 0; i < 100 + ResidualLaw::kRounds; ++i) {
    ResidualLaw::Sample s = r.next();
    s.computed = i < 100 ? 50ms : 0ms;
    r.law.add(r.now(), s);
  }
  EXPECT_NEAR(r.law.near(std::nullopt, {}).within(10ms), (512 + 1 - r.law.tail(10ms)) / 513, 1e-6);
}

TEST(ResidualLaw, TheTailIsHeavyAndFalls) {
  ResidualLaw law;
  law.set_scale(20ms);
  EXPECT_EQ(law.tail(-1ms), 1.0);
  EXPECT_EQ(law.tail(0ms), 1.0);
  EXPECT_DOUBLE_EQ(law.tail(20ms), 0.25);
  EXPECT_DOUBLE_EQ(law.tail(180ms), 0.01);
  // Nothing is known: the tail alone.
  EXPECT_DOUBLE_EQ(law.near(std::nullopt, 1ms).within(20ms), 0.75);
}

// The answers are about those alike, or the few nearest ones.
TEST(ResidualLaw, LooksMoreWidelyWhileTooFewAreAlike) {
  Rounds r;
  const auto add = [&r](std::size_t count, Duration before, Duration computed) {
    for (std::size_t i = 0; i < count; ++i) {
      ResidualLaw::Sample s = r.next();
      s.before = before;
      s.computed = computed;
      r.law.add(r.now(), s);
    }
  };
  add(20, 40ms, 9ms);
  add(ResidualLaw::kLeast - 1, 0ms, 0ms);
  EXPECT_LT(r.law.near(0ms, 5ms).within(5ms), 0.5);
  add(1, 0ms, 0ms);
  EXPECT_GT(r.law.near(0ms, 5ms).within(5ms), 0.95);
  EXPECT_LT(r.law.near(40ms, 5ms).within(5ms), 0.05);
  EXPECT_GT(r.law.near(40ms, 5ms).within(9ms), 0.95);
}

// Not all within a doubled reach: a round that lost 28 ms is not like those that lost none.
TEST(ResidualLaw, TooFewAlikeTakesTheNearestOnly) {
  Rounds r;
  for (int i = 0; i < 20; ++i) {
    ResidualLaw::Sample s = r.next();
    s.before = i % 4 == 0 ? (30 + i) * 1ms : 0ms;
    s.computed = i % 4 == 0 ? 0ms : 90ms;
    r.law.add(r.now(), s);
  }
  EXPECT_GT(r.law.near(28ms, 1ms).within(1ms), 0.95);
}

// 496 rounds lost nothing and the last 16 lost 50 ms each: these weigh as the newest ones do.
TEST(ResidualLaw, TheNewestRoundsCountMost) {
  Rounds r;
  double late = 0;
  double all = 0;
  for (std::size_t i = 0; i < ResidualLaw::kRounds; ++i) {
    ResidualLaw::Sample s = r.next();
    const std::size_t age = ResidualLaw::kRounds - 1 - i;
    s.computed = age < 16 ? 50ms : 0ms;
    r.law.add(r.now(), s);
    const double weight = 1.0 / (1.0 + static_cast<double>(age) / ResidualLaw::kHalf);
    all += weight;
    if (age < 16) late += weight;
  }
  EXPECT_GT(late / all, 4 * 16.0 / ResidualLaw::kRounds);
  EXPECT_NEAR(r.law.near(std::nullopt, {}).within(40ms), (all - late) / all, 0.002);
}

TEST(ResidualLaw, ARoundNeverAnsweredExceedsWhatIsKnownOfIt) {
  ResidualLaw law;
  law.set_scale(20ms);
  law.add(TimePoint{}, {.round = RoundId{1}, .rest = 40ms, .answered = false});
  EXPECT_FALSE(law.base(TimePoint{}, 0));
  // The tail weighs one round, as this one does.
  const auto near = law.near(std::nullopt, {});
  EXPECT_DOUBLE_EQ(near.within(30ms), (0 + 1 - law.tail(30ms)) / 2);
  EXPECT_DOUBLE_EQ(near.within(60ms), (1 - law.tail(20ms) + 1 - law.tail(60ms)) / 2);
}

}  // namespace
}  // namespace interneuron::guard::residual_law_test
