#include "core/guard/residual_law.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/guard/choice.h"

namespace interneuron::guard {
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
    ResidualLaw::Sample s;
    s.round = RoundId{++round_};
    s.at = now_;
    s.before = lost(round_ + 7) / 2;
    return s;
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

std::vector<std::int64_t> rests(const ResidualLaw& law) {
  std::vector<std::int64_t> out;
  for (std::size_t i = 0; i < law.size(); ++i) out.push_back(law.pair(i).rest);
  return out;
}

TEST(ResidualLaw, AConstantOffsetLeavesEveryBitAsItIs) {
  Rounds plain;
  plain.run(700);
  for (const Duration offset :
       {Duration{1h}, Duration{-1h}, Duration{24h}, Duration::max() - 1s, Duration::min() + 1s}) {
    Rounds shifted(offset);
    shifted.run(700);
    EXPECT_EQ(rests(shifted.law), rests(plain.law));
    EXPECT_EQ(wrapping_sub(shifted.law.base(shifted.now(), 0)->count(), offset.count()),
              plain.law.base(plain.now(), 0)->count());
    for (int slack = -10; slack <= 60; ++slack) {
      EXPECT_EQ(shifted.law.near(5ms, 3ms).within(slack * 1ms),
                plain.law.near(5ms, 3ms).within(slack * 1ms));
    }
  }
}

TEST(ResidualLaw, DriftAddsUpForTenSecondsOnly) {
  Rounds still;
  Rounds drifting({}, 200);
  still.run(500);
  drifting.run(500);
  // 10 ms in 50 s; 2 ms in the 10 s that a base is the median of.
  EXPECT_EQ(drifting.offset(), 10ms);
  const auto a = rests(still.law);
  const auto b = rests(drifting.law);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_LE(std::abs(a[i] - b[i]), 2'000'000) << i;
}

TEST(ResidualLaw, ABaseIsTheMedianAndIsForgottenAfterAMinute) {
  Rounds r;
  EXPECT_FALSE(r.law.base(r.now(), 0));
  for (const int ms : {30, 20, 900}) {
    ResidualLaw::Sample s = r.next();
    s.rest = ms * 1ms;
    r.law.add(r.now(), s);
  }
  EXPECT_EQ(r.law.base(r.now(), 0), 30ms);
  EXPECT_EQ(r.law.newest(0), r.now());
  EXPECT_FALSE(r.law.base(r.now(), 1));
  EXPECT_EQ(r.law.base(r.now() + 60s, 0), 30ms);
  EXPECT_FALSE(r.law.base(r.now() + 60s + 1ns, 0));
}

TEST(ResidualLaw, AClockStepCostsTheBasesNotTheLaw) {
  Rounds r;
  r.run(300);
  const auto before = rests(r.law);
  r.law.drop_bases();
  EXPECT_EQ(rests(r.law), before);
  EXPECT_FALSE(r.law.base(r.now(), 0));
  EXPECT_FALSE(r.law.newest(0));
  // What comes after the step has a base of its own.
  ResidualLaw::Sample s = r.next();
  s.rest = 20ms + 5s;
  r.law.add(r.now(), s);
  EXPECT_EQ(r.law.base(r.now(), 0), 20ms + 5s);
  EXPECT_EQ(r.law.size(), 301U);
  EXPECT_EQ(r.law.pair(300).rest, 0);
}

TEST(ResidualLaw, WhatIsToldAgainReplacesWhatWasKnown) {
  Rounds r;
  ResidualLaw::Sample s = r.next();
  s.kind = ResidualLaw::Sample::Kind::kBeyond;
  s.rest = 40ms;
  r.law.add(r.now(), s);
  EXPECT_FALSE(r.law.base(r.now(), 0));
  s.kind = ResidualLaw::Sample::Kind::kKnown;
  s.rest = 70ms;
  r.law.add(r.now(), s);
  EXPECT_EQ(r.law.size(), 1U);
  EXPECT_EQ(r.law.base(r.now(), 0), 70ms);
  EXPECT_FALSE(r.law.pair(0).beyond);
}

TEST(ResidualLaw, KeepsTheLastRoundsOnly) {
  Rounds r;
  r.run(static_cast<int>(ResidualLaw::kRounds) + 100);
  EXPECT_EQ(r.law.size(), ResidualLaw::kRounds);
}

TEST(ResidualLaw, TheTailIsHeavyAndFalls) {
  ResidualLaw law;
  law.set_scale(20ms);
  EXPECT_EQ(law.tail(-1ms), 1.0);
  EXPECT_EQ(law.tail(0ms), 1.0);
  EXPECT_DOUBLE_EQ(law.tail(20ms), 0.25);
  EXPECT_DOUBLE_EQ(law.tail(180ms), 0.01);
  // Nothing is known: the tail alone.
  EXPECT_DOUBLE_EQ(law.near(std::nullopt, 1ms).within(20ms).hedged, 0.75);
}

TEST(ResidualLaw, LooksMoreWidelyWhileTooFewAreAlike) {
  Rounds r;
  const auto add = [&r](int count, Duration before, Duration after) {
    for (int i = 0; i < count; ++i) {
      ResidualLaw::Sample s = r.next();
      s.before = before;
      s.computed = after;
      r.law.add(r.now(), s);
    }
  };
  constexpr int kLeast = ResidualLaw::kLeast;
  add(kLeast - 1, 0ms, 0ms);
  add(20, 40ms, 9ms);
  EXPECT_EQ(r.law.near(0ms, 5ms).size(), kLeast - 1U + 20U);
  add(1, 0ms, 0ms);
  EXPECT_EQ(r.law.near(0ms, 5ms).size(), ResidualLaw::kLeast);
  EXPECT_EQ(r.law.near(40ms, 5ms).size(), 20U);
  EXPECT_EQ(r.law.near(std::nullopt, 5ms).size(), r.law.size());
  // The answers are about those alike.
  EXPECT_GT(r.law.near(0ms, 5ms).within(5ms).hedged, 0.95);
  EXPECT_LT(r.law.near(40ms, 5ms).within(5ms).hedged, 0.05);
  // What the computation loses is no part of the rest.
  EXPECT_GT(r.law.near(40ms, 5ms).rest_within(5ms), 0.95);
}

// Not all within a doubled reach: a round that lost 28 ms is not like those that lost none.
TEST(ResidualLaw, TooFewAlikeTakesTheNearestOnly) {
  Rounds r;
  for (int i = 0; i < 20; ++i) {
    ResidualLaw::Sample s = r.next();
    s.before = i % 4 == 0 ? (30 + i) * 1ms : 0ms;
    r.law.add(r.now(), s);
  }
  EXPECT_EQ(r.law.near(28ms, 1ms).size(), ResidualLaw::kLeast);
}

TEST(ResidualLaw, WhatIsKnownOfAShareNarrowsWithTheRounds) {
  Rounds r;
  const auto known = [&r] { return r.law.near(std::nullopt, 1ms).within(1ms); };
  EXPECT_EQ(known().least, 0.0);
  EXPECT_EQ(known().most, 1.0);
  for (int i = 0; i < 99; ++i) r.law.add(r.now(), r.next());
  EXPECT_DOUBLE_EQ(known().least, 0.99);
  EXPECT_DOUBLE_EQ(known().most, 1.0);
}

// Runs that took 80 ms instead of 40 were accidents until twice as long is what is expected.
TEST(ResidualLaw, ARunIsJudgedByWhatExplainsItBetter) {
  Rounds r;
  Speed speed;
  ResidualLaw::Sample s = r.next();
  s.run = {0, 40ms, 80ms};
  s.computed = 40ms;
  r.law.add(r.now(), s);
  r.law.reconsider(speed);
  EXPECT_EQ(r.law.pair(0).after, 40'000'000);
  for (int i = 0; i < 3; ++i) speed.add(r.now(), 0, 40ms, 80ms);
  r.law.reconsider(speed);
  EXPECT_EQ(r.law.pair(0).after, 0);
  for (int i = 0; i < 64; ++i) speed.add(r.now(), 0, 40ms, 40ms);
  r.law.reconsider(speed);
  EXPECT_EQ(r.law.pair(0).after, 0);
}

TEST(Best, TheValueDecidesUnlessItIsKnownToMissTheTarget) {
  const auto chosen = [](const Worth& rich, const Worth& safe) {
    Best<int> best(0.99);
    best.consider(0, safe);
    best.consider(1, rich);
    return best.get()->first;
  };
  const Worth unknown{{0.80, 1.00, 0.90}, 0.1};
  const Worth known_good{{0.99, 1.00, 0.99}, 0.1};
  const Worth rich_unknown{{0.80, 1.00, 0.90}, 0.3};
  const Worth rich_bad{{0.90, 0.98, 0.95}, 0.3};
  EXPECT_EQ(chosen(rich_unknown, known_good), 1);
  EXPECT_EQ(chosen(rich_bad, unknown), 1);
  EXPECT_EQ(chosen(rich_bad, known_good), 0);
  EXPECT_FALSE(Best<int>(0.99).get());
}

TEST(ResidualLaw, ARoundNeverAnsweredExceedsWhatIsKnownOfIt) {
  Rounds r;
  for (int i = 0; i < 20; ++i) {
    ResidualLaw::Sample s = r.next();
    s.before = 10ms;
    if (i % 2 == 0) {
      s.kind = ResidualLaw::Sample::Kind::kBeyond;
      s.rest = 50ms;  // before + after is more than that
    }
    r.law.add(r.now(), s);
  }
  r.law.set_scale(20ms);
  const auto near = r.law.near(10ms, 1ms);
  EXPECT_EQ(near.size(), 20U);
  EXPECT_EQ(r.law.base(r.now(), 0), 0ms);  // only those that are known count
  const double one = 1.0;                  // the tail weighs one round of twenty
  EXPECT_DOUBLE_EQ(near.within(40ms).hedged, (10 + one * (1 - r.law.tail(40ms))) / 21);
  EXPECT_DOUBLE_EQ(near.within(60ms).hedged, (10 + 10 * 0.75 + one * (1 - r.law.tail(60ms))) / 21);
  EXPECT_DOUBLE_EQ(near.rest_within(60ms), (10 + one * (1 - r.law.tail(60ms))) / 11);
}

}  // namespace
}  // namespace interneuron::guard
