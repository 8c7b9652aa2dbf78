#include "core/offload/roadside_unit.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace interneuron::offload {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;

constexpr Duration kDeadline = 130ms;

std::vector<LevelProfile> three_levels() {
  return {{8ms, 10ms, {}}, {19ms, 24ms, {}}, {44ms, 48ms, {}}};
}

using Unit = RoadsideUnit<int>;

TimePoint at(Duration t) { return TimePoint{t}; }

Unit::Job job(std::uint32_t round, TimePoint delivered, Duration deadline = kDeadline) {
  Unit::Job out;
  out.message.round.round = RoundId{round};
  out.message.deadline = deadline;
  out.delivered = delivered;
  out.top = 2;
  out.input = static_cast<int>(round);
  return out;
}

TEST(RoadsideUnit, HasNothingToDoAtFirst) {
  Unit unit(three_levels());
  EXPECT_EQ(unit.next(at(0ms)), nullptr);
  EXPECT_FALSE(unit.busy());
}

TEST(RoadsideUnit, ComputesOneAtATimeInOrder) {
  Unit unit(three_levels());
  for (std::uint32_t round = 0; round < 3; ++round) unit.add(job(round, at(0ms)));
  for (std::uint32_t round = 0; round < 3; ++round) {
    const Unit::Job* next = unit.next(at(10ms * round));
    ASSERT_NE(next, nullptr);
    EXPECT_EQ(next->message.round.round, RoundId{round});
    EXPECT_EQ(unit.begin(at(10ms * round), 1).input, static_cast<int>(round));
    EXPECT_EQ(unit.next(at(10ms * round)), nullptr) << "the worker is busy";
    const Computed computed = unit.end(at(10ms * round + 9ms));
    EXPECT_EQ(computed.round.round, RoundId{round});
  }
  EXPECT_EQ(unit.computed(), 3u);
  EXPECT_EQ(unit.dropped(), 0u);
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

TEST(RoadsideUnit, DropsWhatNobodyWaitsForAnyMore) {
  Unit unit(three_levels());
  unit.add(job(0, at(0ms)));
  unit.add(job(1, at(1ms)));
  ASSERT_NE(unit.next(at(kDeadline)), nullptr) << "the deadline itself is in time";
  const Unit::Job* next = unit.next(at(kDeadline + 1ns));
  ASSERT_NE(next, nullptr);
  EXPECT_EQ(next->message.round.round, RoundId{1});
  EXPECT_EQ(unit.next(at(1s)), nullptr);
  EXPECT_EQ(unit.dropped(), 2u);
  EXPECT_EQ(unit.waiting(), 0u);
}

TEST(RoadsideUnit, EveryJobHasTheDeadlineOfItsOwnRound) {
  Unit unit(three_levels());
  unit.add(job(0, at(0ms), 1s));
  unit.add(job(1, at(0ms), 50ms));
  unit.add(job(2, at(0ms), 1s));
  ASSERT_NE(unit.next(at(60ms)), nullptr);
  EXPECT_EQ(unit.begin(at(60ms), 0).input, 0);
  unit.end(at(70ms));
  ASSERT_NE(unit.next(at(70ms)), nullptr);
  EXPECT_EQ(unit.begin(at(70ms), 0).input, 2);
}

TEST(RoadsideUnit, RefusesMoreThanTheLineHolds) {
  Unit unit(three_levels());
  for (std::uint32_t i = 0; i < Unit::kMaxWaiting; ++i) EXPECT_TRUE(unit.add(job(i, at(0ms), 1h)));
  EXPECT_FALSE(unit.add(job(100, at(0ms), 1h)));
  EXPECT_EQ(unit.waiting(), Unit::kMaxWaiting);
  EXPECT_EQ(unit.dropped(), 1u);
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  unit.begin(at(0ms), 0);
  EXPECT_TRUE(unit.add(job(101, at(0ms), 1h))) << "one place is free again";
}

TEST(RoadsideUnit, AGivenTopLevelBindsEveryBudget) {
  const Unit unit(three_levels(), 1);
  EXPECT_EQ(unit.levels().size(), 2u);
  EXPECT_EQ(unit.top_level(1s), 1u);
  EXPECT_EQ(unit.top_level(0ms), 1u);
  EXPECT_EQ(Unit(three_levels(), 9).top_level(0ms), 2u) << "beyond the last means the last";
}

TEST(RoadsideUnit, TheTopLevelFollowsTheBudget) {
  const Unit unit(three_levels());
  EXPECT_EQ(unit.levels().size(), 3u);
  EXPECT_EQ(unit.top_level(48ms), 2u);
  EXPECT_EQ(unit.top_level(47ms), 1u);
  EXPECT_EQ(unit.top_level(0ms), 0u);
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
    EXPECT_EQ(unit.top_level(50ms), told ? 1u : 2u);
  }
}

TEST(RoadsideUnit, InputsAreMovedAndNeverCopied) {
  RoadsideUnit<std::unique_ptr<int>> unit(three_levels());
  unit.add({job(0, at(0ms)).message, at(0ms), 0, std::make_unique<int>(42)});
  ASSERT_NE(unit.next(at(0ms)), nullptr);
  EXPECT_EQ(*unit.begin(at(0ms), 0).input, 42);
}

// A unit beside a model of what each job has come to, driven in virtual time.
class Model {
 public:
  explicit Model(std::optional<std::size_t> top_level) : unit_(three_levels(), top_level) {}

  void pass(Duration time) { now_ += time; }
  Duration now() const { return now_.time_since_epoch(); }

  void hand_over(Duration deadline) {
    const std::uint32_t round = next_round_++;
    jobs_[round] = {now_, deadline, !unit_.add(job(round, now_, deadline)), 0};
  }

  // The level is any that the unit offers.
  void take(std::size_t any) {
    const Unit::Job* next = unit_.next(now_);
    if (next == nullptr) return;
    RC_ASSERT(!running_);
    const std::uint32_t round = next->message.round.round.value;
    RC_ASSERT(!newest_ || round > *newest_);
    RC_ASSERT(now_ - jobs_.at(round).delivered <= jobs_.at(round).deadline);
    const std::size_t level = any % unit_.levels().size();
    RC_ASSERT(unit_.begin(now_, level).input == static_cast<int>(round));
    newest_ = running_ = round;
    level_ = level;
  }

  void finish() {
    if (!running_) return;
    const Computed computed = unit_.end(now_, 20ms);
    RC_ASSERT(computed.round.round.value == *running_);
    RC_ASSERT(computed.level == level_);
    RC_ASSERT(computed.delivered <= computed.began && computed.began <= computed.ended);
    ++jobs_.at(*running_).computed;
    running_.reset();
  }

  // Whatever was neither refused nor computed was dropped, and as many as the unit says.
  void check_the_end() {
    finish();
    pass(1h);
    RC_ASSERT(unit_.next(now_) == nullptr);
    RC_ASSERT(unit_.waiting() == 0u);
    std::uint64_t computed = 0;
    for (const auto& [round, fate] : jobs_) {
      RC_ASSERT(fate.computed + (fate.refused ? 1 : 0) <= 1);
      computed += static_cast<std::uint64_t>(fate.computed);
    }
    RC_ASSERT(unit_.computed() == computed);
    RC_ASSERT(unit_.computed() + unit_.dropped() == jobs_.size());
  }

  const Unit& unit() const { return unit_; }

 private:
  struct Fate {
    TimePoint delivered{};
    Duration deadline{};
    bool refused = false;
    int computed = 0;
  };

  Unit unit_;
  TimePoint now_{};
  std::uint32_t next_round_ = 0;
  std::map<std::uint32_t, Fate> jobs_;
  std::optional<std::uint32_t> running_;
  std::optional<std::uint32_t> newest_;
  std::size_t level_ = 0;
};

RC_GTEST_PROP(RoadsideUnit, EveryJobEndsExactlyOnceInOrderAndInTime, ()) {
  std::optional<std::size_t> top_level;
  if (*rc::gen::arbitrary<bool>()) top_level = *rc::gen::inRange<std::size_t>(0, 5);
  Model model(top_level);
  const auto steps = *rc::gen::container<std::vector<std::pair<int, int>>>(
      rc::gen::pair(rc::gen::inRange(0, 6), rc::gen::inRange(0, 200)));
  for (const auto& [what, amount] : steps) {
    if (what == 0) model.pass(milliseconds(amount));
    if (what == 1 || what == 2) model.hand_over(milliseconds(amount));
    if (what == 3 || what == 4) model.take(static_cast<std::size_t>(amount));
    if (what == 5) model.finish();
    RC_ASSERT(model.unit().waiting() <= Unit::kMaxWaiting);
    if (top_level) {
      RC_ASSERT(model.unit().levels().size() <= *top_level + 1);
      RC_ASSERT(model.unit().top_level(milliseconds(amount)) <= *top_level);
    }
    RC_ASSERT(model.unit().top_level(milliseconds(amount)) < model.unit().levels().size());
  }
  model.check_the_end();
}

}  // namespace
}  // namespace interneuron::offload
