#include "core/base/alarms.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <set>
#include <utility>

namespace interneuron::alarms_test {
namespace {

TimePoint at(int ns) { return TimePoint{Duration{ns}}; }

TEST(Alarms, ThereIsNoneAtFirst) {
  Alarms alarms;
  EXPECT_FALSE(alarms.earliest());
  EXPECT_FALSE(alarms.pop_due(TimePoint::max()));
  alarms.remove(7);
}

TEST(Alarms, AreDueInTheOrderOfTimeAndThenOfKeys) {
  Alarms alarms;
  alarms.set(3, at(10));
  alarms.set(1, at(20));
  alarms.set(0, at(10));
  EXPECT_EQ(alarms.earliest(), at(10));
  EXPECT_FALSE(alarms.pop_due(at(9)));
  EXPECT_EQ(alarms.pop_due(at(20)), 0U);
  EXPECT_EQ(alarms.pop_due(at(20)), 3U);
  EXPECT_EQ(alarms.pop_due(at(20)), 1U);
  EXPECT_FALSE(alarms.pop_due(at(20)));
}

TEST(Alarms, AnAlarmMovesBothWays) {
  Alarms alarms;
  for (Alarms::Key key = 0; key < 8; ++key) alarms.set(key, at(100 + static_cast<int>(key)));
  alarms.set(6, at(1));
  EXPECT_EQ(alarms.earliest(), at(1));
  alarms.set(6, at(1000));
  alarms.remove(0);
  EXPECT_EQ(alarms.earliest(), at(101));
  EXPECT_EQ(alarms.size(), 7U);
}

enum class Step { kSet, kRemove, kPop };

// Against a set of (time, key) pairs with the time of each key beside it.
RC_GTEST_PROP(Alarms, DoWhatAnOrderedSetDoes, ()) {
  Alarms alarms;
  std::set<std::pair<TimePoint, Alarms::Key>> model;
  std::map<Alarms::Key, TimePoint> times;
  const auto forget = [&](Alarms::Key key) {
    if (const auto it = times.find(key); it != times.end()) {
      model.erase({it->second, key});
      times.erase(it);
    }
  };
  const int steps = *rc::gen::inRange(0, 400);
  for (int i = 0; i < steps; ++i) {
    const auto key = *rc::gen::inRange<Alarms::Key>(0, 24);
    const TimePoint time = at(*rc::gen::inRange(0, 30));
    switch (*rc::gen::element(Step::kSet, Step::kRemove, Step::kPop)) {
      case Step::kSet:
        alarms.set(key, time);
        forget(key);
        model.emplace(time, key);
        times.emplace(key, time);
        break;
      case Step::kRemove:
        alarms.remove(key);
        forget(key);
        break;
      case Step::kPop: {
        const auto due = alarms.pop_due(time);
        const bool any = !model.empty() && model.begin()->first <= time;
        RC_ASSERT(due.has_value() == any);
        if (!any) break;
        RC_ASSERT(*due == model.begin()->second);
        forget(*due);
      }
    }
    RC_ASSERT(alarms.size() == model.size());
    RC_ASSERT(alarms.earliest().has_value() == !model.empty());
    if (!model.empty()) RC_ASSERT(*alarms.earliest() == model.begin()->first);
  }
}

}  // namespace
}  // namespace interneuron::alarms_test
