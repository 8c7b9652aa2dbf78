#include "app/computing/roadside_unit.h"

#include <gtest/gtest.h>

#include <memory>

#include "support.h"

namespace interneuron::computing::roadside_unit_test {
namespace {

TEST(RoadsideUnit, HasNothingToDoAtFirst) {
  Unit unit(three_levels());
  EXPECT_EQ(unit.next(at(0ms)), nullptr);
  EXPECT_FALSE(unit.busy());
}

TEST(RoadsideUnit, ComputesOneAtATimeInOrder) {
  Unit unit(three_levels());
  for (std::uint32_t round = 0; round < 2; ++round) unit.add(job(round, at(0ms)));
  for (std::uint32_t round = 0; round < 2; ++round) {
    const Unit::Job* next = unit.next(at(10ms * round));
    ASSERT_NE(next, nullptr);
    EXPECT_EQ(next->message.round.round, RoundId{round});
    EXPECT_EQ(unit.begin(at(10ms * round), 1).input, static_cast<int>(round));
    EXPECT_EQ(unit.next(at(10ms * round)), nullptr) << "the worker is busy";
    const Computed computed = unit.end(at(10ms * round + 9ms));
    EXPECT_EQ(computed.round.round, RoundId{round});
  }
  EXPECT_EQ(unit.total().computed, 2u);
  EXPECT_EQ(unit.total().unanswered(), 0u);
  EXPECT_EQ(unit.total().busy, 18ms);
}

TEST(RoadsideUnit, TellsWhatHappenedToAJob) {
  Unit unit(three_levels());
  Unit::Job input = job(7, at(100ms));
  input.message.from = PeerId{3};
  input.message.variant = 1;
  input.message.degraded = true;
  unit.add(std::move(input));
  ASSERT_NE(unit.next(at(105ms)), nullptr);
  unit.begin(at(105ms), 2);
  const Computed computed = unit.end(at(150ms));
  EXPECT_EQ(computed.from, PeerId{3});
  EXPECT_EQ(computed.variant, 1);
  EXPECT_TRUE(computed.degraded);
  EXPECT_EQ(computed.level, 2u);
  EXPECT_EQ(computed.delivered, at(100ms));
  EXPECT_EQ(computed.began, at(105ms));
  EXPECT_EQ(computed.ended, at(150ms));
}

TEST(RoadsideUnit, EndsAndTellsWhatCannotBeInTimeAnyMore) {
  Unit unit(three_levels());
  unit.add(job(0, at(0ms)));
  unit.add(job(1, at(1ms)));
  const Duration last = kDeadline - 8ms;
  ASSERT_NE(unit.next(at(last)), nullptr) << "the lightest level takes 8 ms and just makes it";
  EXPECT_EQ(unit.next_timeout(), at(last + 1ns));
  const Unit::Job* next = unit.next(at(last + 1ns));
  ASSERT_NE(next, nullptr);
  EXPECT_EQ(next->message.round.round, RoundId{1});
  EXPECT_EQ(unit.next(at(1s)), nullptr);
  EXPECT_EQ(unit.next_timeout(), std::nullopt);
  const auto told = unanswered(unit);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0].round.round, RoundId{0});
  EXPECT_EQ(told[0].why, NoAnswer::kTooLate);
  EXPECT_EQ(told[1].round.round, RoundId{1});
  EXPECT_EQ(unit.total().too_late, 2u);
  EXPECT_EQ(unit.waiting(), 0u);
}

TEST(RoadsideUnit, IsToldOfWhatIsLateWhileTheWorkerIsBusy) {
  Unit unit(three_levels());
  unit.add(job(0, at(0ms)));
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  unit.begin(at(0ms), 2);
  unit.add(job(1, at(0ms)));
  ASSERT_TRUE(unit.next_timeout());
  EXPECT_EQ(unit.next(*unit.next_timeout()), nullptr);
  EXPECT_EQ(unanswered(unit).size(), 1u);
}

TEST(RoadsideUnit, ComputesWhatIsLateWhereToldTo) {
  Unit unit(three_levels(), std::nullopt, {.waiting_per_peer = 100, .minds_deadlines = false});
  for (std::uint32_t round = 0; round < 10; ++round) unit.add(job(round, at(0ms)));
  EXPECT_EQ(unit.next_timeout(), std::nullopt);
  for (std::uint32_t round = 0; round < 10; ++round) {
    ASSERT_NE(unit.next(at(1h)), nullptr);
    EXPECT_EQ(unit.begin(at(1h), 0).input, static_cast<int>(round));
    unit.end(at(1h));
  }
}

TEST(RoadsideUnit, OfOnePeerWhatIsDueFirstIsNext) {
  Unit unit(three_levels());
  unit.add(job(0, at(0ms), 1s));
  unit.add(job(1, at(10ms), 50ms));
  ASSERT_NE(unit.next(at(10ms)), nullptr);
  EXPECT_EQ(unit.begin(at(10ms), 0).input, 1);
  unit.end(at(20ms));
  ASSERT_NE(unit.next(at(20ms)), nullptr);
  EXPECT_EQ(unit.begin(at(20ms), 0).input, 0);
}

TEST(RoadsideUnit, DeadlinesAreBelievedUpToABound) {
  Unit unit(three_levels());
  unit.add(job(0, at(0ms), 71min));
  EXPECT_NE(unit.next(at(kLongestBelieved - 8ms)), nullptr);
  EXPECT_EQ(unit.next(at(kLongestBelieved)), nullptr);
  unit.add(job(1, at(kLongestBelieved), Duration::max()));
  EXPECT_EQ(unit.next_timeout(), at(2 * kLongestBelieved - 8ms + 1ns));
}

TEST(RoadsideUnit, WhoSendsTooMuchCrowdsOutItself) {
  Unit unit(three_levels());
  unit.add(job_of(1, 0, at(0ms)));
  unit.add(job_of(1, 1, at(0ms)));
  for (std::uint32_t i = 0; i < 100; ++i) unit.add(job_of(2, i, at(0ms), 71min));
  EXPECT_EQ(unit.waiting(), 4u);
  EXPECT_EQ(unit.work(PeerId{1}).unanswered(), 0u);
  EXPECT_EQ(unit.work(PeerId{2}).crowded_out, 98u);
  const auto told = unanswered(unit);
  ASSERT_EQ(told.size(), 98u);
  for (std::uint32_t i = 0; i < told.size(); ++i) {
    EXPECT_EQ(told[i].round.round, RoundId{i}) << "its oldest goes";
    EXPECT_EQ(told[i].from, PeerId{2});
    EXPECT_EQ(told[i].why, NoAnswer::kCrowdedOut);
  }
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  EXPECT_EQ(unit.begin(at(0ms), 0).message.from, PeerId{1});
  unit.end(at(8ms));
}

TEST(RoadsideUnit, AFloodCostsNoMoreThanOneJobOfWaiting) {
  Unit unit(three_levels());
  Duration served{};
  TimePoint now{};
  std::uint32_t computed = 0;
  for (std::uint32_t i = 0; i < 100; ++i) {
    const TimePoint came = at(100ms * i);
    unit.add(job_of(1, i, came));
    while (now < came + 100ms) {
      unit.add(job_of(2, i, came, 71min));
      const Unit::Job* next = unit.next(std::max(now, came));
      ASSERT_NE(next, nullptr);
      now = std::max(now, came);
      const bool honest = next->message.from == PeerId{1};
      EXPECT_TRUE(!honest || now - next->delivered <= 20ms);
      computed += honest ? 1 : 0;
      unit.begin(now, 0);
      now += 20ms;
      unit.end(now);
      served += 20ms;
    }
  }
  EXPECT_EQ(computed, 100u);
  EXPECT_EQ(unit.work(PeerId{1}).busy + unit.work(PeerId{2}).busy, served);
}

TEST(RoadsideUnit, WhatCannotBeReadIsToldAndCharged) {
  Unit unit(three_levels());
  unit.add(job_of(1, 7, at(0ms)));
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  unit.begin(at(0ms), 0);
  unit.fail(at(50ms));
  EXPECT_FALSE(unit.busy());
  EXPECT_EQ(unit.work(PeerId{1}).busy, 50ms);
  unit.reject(job_of(1, 8, at(60ms)).message);
  const auto told = unanswered(unit);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0].round.round, RoundId{7});
  EXPECT_EQ(told[1].round.round, RoundId{8});
  EXPECT_EQ(told[1].why, NoAnswer::kUnreadable);
  EXPECT_EQ(unit.work(PeerId{1}).unreadable, 2u);

  unit.add(job_of(1, 9, at(60ms)));
  unit.add(job_of(2, 0, at(60ms)));
  ASSERT_NE(unit.next(at(60ms)), nullptr);
  EXPECT_EQ(unit.next(at(60ms))->message.from, PeerId{2}) << "the other's turn comes first now";
}

TEST(RoadsideUnit, ThePeerThatIsLostTakesItsJobsAlong) {
  Unit unit(three_levels());
  unit.add(job_of(1, 0, at(0ms)));
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  unit.begin(at(0ms), 0);
  unit.add(job_of(1, 1, at(0ms)));
  unit.add(job_of(2, 0, at(0ms)));
  unit.forget(PeerId{1});
  unit.forget(PeerId{3});
  EXPECT_EQ(unit.waiting(), 1u);
  EXPECT_EQ(unit.end(at(9ms), 9ms).from, PeerId{1});
  EXPECT_EQ(unit.work(PeerId{1}).busy, 0ms) << "it is not known any more";
  EXPECT_TRUE(unanswered(unit).empty());
  ASSERT_NE(unit.next(at(9ms)), nullptr);
  EXPECT_EQ(unit.next(at(9ms))->message.from, PeerId{2});
}

TEST(RoadsideUnit, OffersWhatFitsIntoThePartOfThePeer) {
  Unit unit(three_levels());
  for (int i = 0; i < 20; ++i) unit.add(job_of(1, 0, at(50ms * i)));
  EXPECT_EQ(unit.levels(PeerId{1}, at(1s)).size(), 3u) << "alone it may take any level";
  for (int i = 0; i < 20; ++i) unit.add(job_of(2, 0, at(950ms)));
  EXPECT_EQ(unit.levels(PeerId{1}, at(950ms)).size(), 2u) << "25 ms";
  EXPECT_EQ(unit.levels(PeerId{2}, at(950ms)).size(), 1u) << "at least the lowest";
  EXPECT_EQ(unit.levels().size(), 3u);
}

TEST(RoadsideUnit, WhoSendsNothingThatCouldBeComputedTakesNoPart) {
  Unit unit(three_levels());
  for (int i = 0; i < 20; ++i) {
    unit.add(job_of(1, 0, at(50ms * i)));
    for (std::uint32_t peer = 2; peer < 30; ++peer) unit.reject(job_of(peer, 0, {}).message);
  }
  EXPECT_EQ(unit.levels(PeerId{1}, at(1s)).size(), 3u);
}

TEST(RoadsideUnit, SlowImagesOfOnePeerDoNotMakeTheLevelsSlowForAnother) {
  Unit unit(three_levels());
  for (std::uint32_t i = 0; i < 10; ++i) {
    const TimePoint now = at(100ms * i);
    unit.add(job_of(2, i, now));
    ASSERT_NE(unit.next(now), nullptr);
    unit.begin(now, 2);
    unit.end(now + 90ms, 90ms);
  }
  EXPECT_EQ(unit.top_level(PeerId{2}, 50ms), 1u);
  EXPECT_EQ(unit.top_level(PeerId{1}, 50ms), 2u);
}

TEST(RoadsideUnit, AGivenTopLevelBindsEveryBudget) {
  const Unit unit(three_levels(), 1);
  EXPECT_EQ(unit.levels().size(), 2u);
  EXPECT_EQ(unit.top_level(PeerId{}, 1s), 1u);
  EXPECT_EQ(unit.top_level(PeerId{}, 0ms), 1u);
  EXPECT_EQ(Unit(three_levels(), 9).top_level(PeerId{}, 0ms), 2u)
      << "beyond the last means the last";
}

TEST(RoadsideUnit, TheTopLevelFollowsTheBudget) {
  const Unit unit(three_levels());
  EXPECT_EQ(unit.levels().size(), 3u);
  EXPECT_EQ(unit.top_level(PeerId{}, 48ms), 2u);
  EXPECT_EQ(unit.top_level(PeerId{}, 47ms), 1u);
  EXPECT_EQ(unit.top_level(PeerId{}, 0ms), 0u);
}

TEST(RoadsideUnit, LearnsOnlyTheRunTimesThatItIsTold) {
  for (const bool told : {true, false}) {
    Unit unit(three_levels());
    for (std::uint32_t i = 0; i < 5; ++i) {
      const TimePoint now = at(100ms * i);
      unit.add(job(i, now));
      ASSERT_NE(unit.next(now), nullptr);
      unit.begin(now, 2);
      unit.end(now + 80ms, told ? std::optional<Duration>(80ms) : std::nullopt);
    }
    EXPECT_EQ(unit.top_level(PeerId{}, 50ms), told ? 1u : 2u);
  }
}

TEST(RoadsideUnit, InputsAreMovedAndNeverCopied) {
  RoadsideUnit<std::unique_ptr<int>> unit(three_levels());
  unit.add({job(0, at(0ms)).message, at(0ms), 0, std::make_unique<int>(42)});
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  EXPECT_EQ(*unit.begin(at(0ms), 0).input, 42);
}

}  // namespace
}  // namespace interneuron::computing::roadside_unit_test
