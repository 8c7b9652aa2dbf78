#include "core/guard/round_ledger.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace interneuron::guard::round_ledger_test {
namespace {

using namespace std::chrono_literals;

PipelineConfig camera() {
  return PipelineConfig{.stages = offload_stages(), .guard = GuardKind::kPaper};
}

Bytes bytes(int n) { return Bytes{static_cast<std::byte>(n)}; }

constexpr SessionId kSelf{7};

TEST(Origin, ARemoteResultExactlyAtTheDeadlineIsOnTime) {
  RoundLedger o(camera(), kSelf);
  const auto begun = o.begin(TimePoint{1s});
  const auto done = o.remote_result(TimePoint{1s + 130ms}, begun.ref.round, bytes(1), false);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->outcome, Outcome::kRemote);
  EXPECT_EQ(done->e2e, 130ms);
  EXPECT_EQ(done->age_rounds, 0U);
  EXPECT_TRUE(o.expire(TimePoint{10s}).empty());  // exactly one outcome
}

TEST(Origin, OneNanosecondLaterItIsDropped) {
  RoundLedger o(camera(), kSelf);
  const auto begun = o.begin(TimePoint{1s});
  EXPECT_FALSE(o.remote_result(TimePoint{1s + 130ms + 1ns}, begun.ref.round, bytes(1), false));
  const auto done = o.expire(TimePoint{1s + 131ms});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].outcome, Outcome::kLocal);
}

TEST(Origin, TheLocalBackupAnswersAtTheDeadline) {
  RoundLedger o(camera(), kSelf);
  const auto begun = o.begin(TimePoint{1s});
  o.local_result(begun.t0, begun.ref.round, bytes(9));
  EXPECT_EQ(o.next_timeout(), TimePoint{1s + 130ms});
  EXPECT_TRUE(o.expire(TimePoint{1s + 130ms - 1ns}).empty());
  const auto done = o.expire(TimePoint{1s + 130ms});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].result, bytes(9));
  EXPECT_EQ(done[0].age_rounds, 0U);
}

TEST(Origin, WithoutABackupTheLastResultIsMarkedWithItsAge) {
  RoundLedger o(camera(), kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, first.ref.round, bytes(1), false);
  o.begin(TimePoint{2s});
  o.begin(TimePoint{3s});
  const auto done = o.expire(TimePoint{4s});
  ASSERT_EQ(done.size(), 2U);
  EXPECT_EQ(done[0].age_rounds, 1U);
  EXPECT_EQ(done[1].age_rounds, 2U);
  EXPECT_EQ(done[1].result, bytes(1));
}

TEST(Origin, WithNothingAtAllTheAnswerIsEmptyAndMarkedSo) {
  RoundLedger o(camera(), kSelf);
  o.begin(TimePoint{1s});
  const auto done = o.expire(TimePoint{2s});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_TRUE(done[0].result.empty());
  EXPECT_FALSE(done[0].age_rounds);
}

TEST(Origin, AForwardJumpAnswersOpenRoundsAtOnce) {
  RoundLedger o(camera(), kSelf);
  o.begin(TimePoint{1s});
  o.begin(TimePoint{1s + 100ms});
  EXPECT_EQ(o.expire(TimePoint{1h}).size(), 2U);
}

TEST(Origin, TheIndicatorTellsTheRoundsBefore) {
  RoundLedger o(camera(), kSelf);
  const auto r0 = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, r0.ref.round, bytes(1), false);
  o.begin(TimePoint{2s});
  o.expire(TimePoint{3s});
  o.begin(TimePoint{3s});
  const auto r3 = o.begin(TimePoint{3s + 100ms});
  const Indicator i = o.indicator(r3.ref.round);
  EXPECT_EQ(i[0], RoundState::kUnknown);
  EXPECT_EQ(i[1], RoundState::kMissed);
  EXPECT_EQ(i[2], RoundState::kOnTime);
  EXPECT_EQ(i[3], RoundState::kUnknown);
}

// A detector whose results lose 40 % of their quality in one round, 80 % in two.
PipelineConfig with_fallback() {
  PipelineConfig c = camera();
  c.levels = {{8ms, 10ms, {0.14}}, {44ms, 46ms, {0.40, 0.38}}};
  c.fallback = {0.14, {0.6, 0.2}};
  return c;
}

Spent level(std::uint8_t n) {
  Spent s;
  s.level = n;
  s.variant = 0;
  return s;
}

TEST(Origin, TheLastRemoteResultAnswersWhereItIsWorthMoreThanTheLocalOne) {
  RoundLedger o(with_fallback(), kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, first.ref.round, bytes(1), false, level(1));
  for (int i = 1; i <= 2; ++i) {
    const auto begun = o.begin(TimePoint{1s + i * 100ms});
    o.local_result(begun.t0, begun.ref.round, bytes(9));
  }
  const auto done = o.expire(TimePoint{4s});
  ASSERT_EQ(done.size(), 2U);
  EXPECT_TRUE(done[0].stale_remote);  // 0.40 · 0.6 > 0.14
  EXPECT_EQ(done[0].result, bytes(1));
  EXPECT_EQ(done[0].age_rounds, 1U);
  EXPECT_FALSE(done[1].stale_remote);  // 0.40 · 0.2 < 0.14
  EXPECT_EQ(done[1].result, bytes(9));
  EXPECT_EQ(done[1].age_rounds, 0U);
}

TEST(Origin, ALowLevelResultThatIsOldIsWorthLessThanTheLocalOne) {
  RoundLedger o(with_fallback(), kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, first.ref.round, bytes(1), false, level(0));
  o.local_result(TimePoint{2s}, o.begin(TimePoint{2s}).ref.round, bytes(9));
  EXPECT_EQ(o.expire(TimePoint{3s}).at(0).result, bytes(9));
}

TEST(Origin, WithoutALocalResultAnOldRemoteOneIsMarkedSo) {
  RoundLedger o(with_fallback(), kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, first.ref.round, bytes(1), false, level(0));
  o.begin(TimePoint{2s});
  const auto done = o.expire(TimePoint{3s});
  EXPECT_TRUE(done.at(0).stale_remote);
  EXPECT_EQ(done.at(0).age_rounds, 1U);
}

TEST(Origin, WithoutFallbackQualityTheLocalResultAnswers) {
  PipelineConfig config = with_fallback();
  config.fallback = {};
  RoundLedger o(config, kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, first.ref.round, bytes(1), false, level(1));
  o.local_result(TimePoint{2s}, o.begin(TimePoint{2s}).ref.round, bytes(9));
  const auto done = o.expire(TimePoint{3s});
  EXPECT_EQ(done.at(0).result, bytes(9));
  EXPECT_FALSE(done.at(0).stale_remote);
}

TEST(Origin, ARoundThatStaysHereIsAnsweredOnceByItsLocalResult) {
  for (const bool result_first : {false, true}) {
    RoundLedger o(with_fallback(), kSelf);
    const auto begun = o.begin(TimePoint{1s});
    const RoundId round = begun.ref.round;
    std::optional<RoundDone> first;
    std::optional<RoundDone> second;
    if (result_first) {
      first = o.local_result(TimePoint{1s + 9ms}, round, bytes(9));
      second = o.stay_local(TimePoint{1s + 10ms}, round);
    } else {
      first = o.stay_local(TimePoint{1s + 1ms}, round);
      second = o.local_result(TimePoint{1s + 10ms}, round, bytes(9));
    }
    EXPECT_FALSE(first);
    ASSERT_TRUE(second);
    EXPECT_EQ(second->outcome, Outcome::kLocal);
    EXPECT_EQ(second->e2e, 10ms);
    EXPECT_EQ(second->result, bytes(9));
    EXPECT_EQ(second->age_rounds, 0U);
    EXPECT_FALSE(o.local_result(TimePoint{1s + 11ms}, round, bytes(8)));
    EXPECT_FALSE(o.remote_result(TimePoint{1s + 12ms}, round, bytes(1), false, level(1)));
    EXPECT_TRUE(o.expire(TimePoint{4s}).empty());
    EXPECT_EQ(o.indicator(RoundId{1})[0], RoundState::kUnknown);  // no miss
  }
}

TEST(Origin, ARoundThatStaysHereWithoutALocalResultIsAnsweredAtItsDeadline) {
  RoundLedger o(with_fallback(), kSelf);
  EXPECT_FALSE(o.stay_local(TimePoint{1s}, o.begin(TimePoint{1s}).ref.round));
  EXPECT_EQ(o.next_timeout(), TimePoint{1s + 130ms});
  const auto done = o.expire(TimePoint{1s + 130ms});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_FALSE(done[0].age_rounds);
  EXPECT_EQ(o.indicator(RoundId{1})[0], RoundState::kUnknown);
}

TEST(Origin, ARoundThatIsGivenUpIsMissedAndAnsweredAtOnce) {
  for (const bool result_first : {false, true}) {
    RoundLedger o(with_fallback(), kSelf);
    const RoundId round = o.begin(TimePoint{1s}).ref.round;
    EXPECT_FALSE(result_first && o.local_result(TimePoint{1s + 9ms}, round, bytes(9)));
    auto done = o.give_up(TimePoint{1s + 10ms}, round);
    EXPECT_EQ(done.has_value(), result_first);
    if (!result_first) done = o.local_result(TimePoint{1s + 10ms}, round, bytes(9));
    ASSERT_TRUE(done);
    EXPECT_EQ(done->outcome, Outcome::kLocal);
    EXPECT_EQ(done->e2e, 10ms);
    EXPECT_EQ(done->result, bytes(9));
    EXPECT_EQ(o.indicator(RoundId{1})[0], RoundState::kMissed);
    EXPECT_FALSE(o.give_up(TimePoint{1s + 11ms}, round));
    EXPECT_FALSE(o.remote_result(TimePoint{1s + 12ms}, round, bytes(1), false, level(1)));
    EXPECT_TRUE(o.expire(TimePoint{4s}).empty());
  }
}

TEST(Origin, ARemoteResultForARoundThatWasGivenUpStillCounts) {
  RoundLedger o(with_fallback(), kSelf);
  const RoundId round = o.begin(TimePoint{1s}).ref.round;
  EXPECT_FALSE(o.give_up(TimePoint{1s + 10ms}, round));
  const auto done = o.remote_result(TimePoint{1s + 20ms}, round, bytes(1), false, level(1));
  ASSERT_TRUE(done);
  EXPECT_EQ(done->outcome, Outcome::kRemote);
  EXPECT_FALSE(o.give_up(TimePoint{1s + 30ms}, RoundId{7})) << "it never began";
}

TEST(Origin, ARoundThatIsGivenUpWithoutALocalResultIsAnsweredAtItsDeadline) {
  RoundLedger o(with_fallback(), kSelf);
  EXPECT_FALSE(o.give_up(TimePoint{1s}, o.begin(TimePoint{1s}).ref.round));
  const auto done = o.expire(TimePoint{1s + 130ms});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(o.indicator(RoundId{1})[0], RoundState::kMissed);
}

// Too late for its own round, it is the newest there is for the next one.
TEST(Origin, ALateRemoteResultIsLearntAndMayAnswerTheNextRound) {
  RoundLedger o(with_fallback(), kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.begin(TimePoint{1s + 100ms});
  o.expire(TimePoint{1s + 130ms});
  EXPECT_FALSE(o.remote_result(TimePoint{1s + 150ms}, first.ref.round, bytes(1), false, level(1)));
  EXPECT_EQ(o.recent_e2e(RoundId{1})[0], E2e{150ms});
  EXPECT_EQ(o.indicator(RoundId{1})[0], RoundState::kMissed);
  const auto done = o.expire(TimePoint{1s + 230ms});
  EXPECT_TRUE(done.at(0).stale_remote);
  EXPECT_EQ(done.at(0).result, bytes(1));
}

TEST(Origin, EndToEndTimesOfTheRoundsBeforeAreTold) {
  RoundLedger o(camera(), kSelf);
  o.remote_result(TimePoint{1s + 70ms}, o.begin(TimePoint{1s}).ref.round, bytes(1), false);
  o.begin(TimePoint{2s});
  o.expire(TimePoint{3s});
  const auto recent = o.recent_e2e(o.begin(TimePoint{3s}).ref.round);
  EXPECT_EQ(recent[0], E2e{kNever});
  EXPECT_EQ(recent[1], E2e{70ms});
  EXPECT_EQ(recent[2], E2e{});
}

TEST(Origin, RefusesBudgetsThatMeanNothing) {
  const auto throws = [](auto change) {
    PipelineConfig c = with_fallback();
    change(c);
    EXPECT_THROW(RoundLedger(c, kSelf), std::invalid_argument);
  };
  throws([](PipelineConfig& c) { c.budget.miss_price = -0.1; });
  throws([](PipelineConfig& c) { c.levels[0].median = 0ms; });
  throws([](PipelineConfig& c) { c.fallback.local = 1.5; });
  throws([](PipelineConfig& c) { c.fallback.stale_share[0] = -1; });
}

TEST(Origin, RefusesWhatCannotBeAPipeline) {
  PipelineConfig none = camera();
  none.stages.clear();
  EXPECT_THROW(RoundLedger(none, kSelf), std::invalid_argument);
  PipelineConfig zero = camera();
  zero.deadline = 0ms;
  EXPECT_THROW(RoundLedger(zero, kSelf), std::invalid_argument);
  PipelineConfig period = camera();
  period.period = -1ms;
  EXPECT_THROW(RoundLedger(period, kSelf), std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::guard::round_ledger_test
