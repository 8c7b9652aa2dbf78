// How a path that is new begins: low where it met others.
#include "core/cc/newcomer.h"

#include <gtest/gtest.h>

#include <chrono>

namespace interneuron::cc::newcomer_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRoundTrip = 40ms;

TimePoint at(Duration d) { return TimePoint{d}; }

// How many messages, 100 ms apart, are held low.
int small_messages(Newcomer& path, bool met, double part, Duration first = 1s) {
  int small = 0;
  for (int i = 0; i < 10; ++i) {
    path.asked(at(first + i * 100ms), met, part, kRoundTrip);
    small += path.is_held_low() ? 1 : 0;
  }
  return small;
}

TEST(Newcomer, WhoMetNobodyBeginsAsTrainsAllow) {
  Newcomer path;
  path.sent(at(0s));
  path.told();
  path.train_waited(2ms);
  EXPECT_EQ(small_messages(path, false, 0.9), 0);
  EXPECT_FALSE(path.begins_low());
}

TEST(Newcomer, WhoMetOthersBeginsWithOneToThreeSmallMessages) {
  for (const double part : {0.0, 0.3, 0.34, 0.6, 0.67, 0.999}) {
    Newcomer path;
    EXPECT_EQ(small_messages(path, true, part), 1 + static_cast<int>(3 * part)) << part;
    EXPECT_TRUE(path.begins_low());
  }
}

TEST(Newcomer, OthersThatComeLaterDoNotHoldItLow) {
  Newcomer path;
  path.asked(at(1s), false, 0.9, kRoundTrip);
  path.asked(at(1100ms), true, 0.9, kRoundTrip);
  EXPECT_FALSE(path.is_held_low());
  EXPECT_FALSE(path.begins_low());
}

TEST(Newcomer, ATrainThatWaitedMetOthers) {
  Newcomer path;
  path.train_waited(30ms);
  EXPECT_EQ(small_messages(path, false, 0), 1);
}

TEST(Newcomer, WhatIsNotToldOfInTimeWaitsBehindOthers) {
  Newcomer late;
  late.sent(at(1s));
  EXPECT_EQ(small_messages(late, false, 0, 1s + kRoundTrip + 30ms), 1);
  Newcomer soon;
  soon.sent(at(1s));
  EXPECT_EQ(small_messages(soon, false, 0, 1s + kRoundTrip), 0);
  // What is not told of at all was lost, or nobody listens.
  Newcomer never;
  never.sent(at(1s));
  EXPECT_EQ(small_messages(never, false, 0, 3s), 0);
  // The round trip is not known: nothing was told of anything.
  Newcomer deaf;
  deaf.sent(at(1s));
  deaf.asked(at(1200ms), false, 0, {});
  EXPECT_FALSE(deaf.is_held_low());
}

TEST(Newcomer, IsNewForTwoSecondsOfMessagesOrUntilOthersAreFound) {
  Newcomer path;
  EXPECT_TRUE(path.is_new(at(1h)));
  path.asked(at(1h), false, 0, kRoundTrip);
  EXPECT_TRUE(path.is_new(at(1h + 2s)));
  EXPECT_FALSE(path.is_new(at(1h + 2001ms)));
  Newcomer found;
  found.asked(at(0s), false, 0, kRoundTrip);
  found.end();
  EXPECT_FALSE(found.is_new(at(1ms)));
}

}  // namespace
}  // namespace interneuron::cc::newcomer_test
