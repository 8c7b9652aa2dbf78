#include "core/cc/share_control.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace interneuron::cc::share_control_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kBase = 40ms;
constexpr DataRate kPipe = DataRate::mbit(60);

ShareControl::Train train(double arrived, double sent, std::uint32_t packets = 40) {
  return {packets, DataRate::mbit(arrived), DataRate::mbit(sent)};
}

// What a path tells every 5 ms while something is queued, and how its queue does.
struct Path {
  ShareControl control;
  TimePoint now{1h};
  Duration queue{};
  ShareControl::Report next() {
    ShareControl::Report report;
    report.capacity = kPipe;
    report.round_trip = kBase + queue;
    report.one_way_us = static_cast<std::uint32_t>((kBase / 2 + queue).count() / 1000);
    return report;
  }
  // So many reports of a path on which something always waits.
  void overload(int reports) {
    for (int i = 0; i < reports; ++i) {
      now += 5ms;
      ShareControl::Report report = next();
      report.held_back = true;
      report.backlog = 5ms;
      control.report(now, report);
    }
  }
  void idle(Duration length) {
    now += length;
    control.report(now, next());
  }
  // So many frames a tenth of a second apart, which leave at 75 Mbit/s.
  void frames(int count, double arrive_at) {
    for (int i = 0; i < count; ++i) {
      now += 100ms;
      ShareControl::Report report = next();
      report.train = train(arrive_at, 75);
      control.report(now, report);
    }
  }
  double mbit() const { return control.rate()->mbit(); }
};

TEST(ShareControl, NothingIsLimitedWhileThePipeIsNotKnown) {
  ShareControl control;
  EXPECT_FALSE(control.rate());
  EXPECT_FALSE(control.pace());
  EXPECT_EQ(control.window(), std::numeric_limits<std::size_t>::max());
  control.report(TimePoint{1s}, {});
  EXPECT_FALSE(control.rate());
}

TEST(ShareControl, AFreePipeIsAllOurs) {
  Path path;
  path.overload(200);
  EXPECT_DOUBLE_EQ(path.mbit(), 60);
  EXPECT_FALSE(path.control.pace()) << "the search for the capacity sets the pace";
}

TEST(ShareControl, WhatIsInFlightIsARoundTripAndTheTarget) {
  Path path;
  path.overload(20);
  const double seconds = 1e-9 * static_cast<double>((kBase + ShareControl::kTarget).count());
  EXPECT_NEAR(static_cast<double>(path.control.window()), 60e6 / 8 * seconds, 1500);
}

// Radio adds delay to every packet of a path and spreads none of them.
TEST(ShareControl, DelayAloneIsNoCongestion) {
  Path path;
  path.idle(100ms);
  path.queue = 400ms;
  for (int i = 0; i < 100; ++i) {
    path.now += 100ms;
    ShareControl::Report report = path.next();
    report.backlog = 17ms;
    report.held_back = true;
    report.train = train(59, 75);
    path.control.report(path.now, report);
  }
  EXPECT_DOUBLE_EQ(path.mbit(), 60);
}

// Others have filled the queue while nothing of ours left.
TEST(ShareControl, AQueueThatStretchesTrainsIsGivenWayTo) {
  Path path;
  path.idle(100ms);
  path.queue = 35ms;
  path.idle(100ms);
  path.queue = 70ms;
  path.frames(30, 20);
  // Not below what arrives.
  EXPECT_NEAR(path.mbit(), 18, 1);
}

// A radio that fades delays what is on its way all at once, and stretches the next trains.
TEST(ShareControl, ATrainThatIsStretchedWhereNobodyElseIsIsAFade) {
  Path path;
  for (int i = 0; i < 30; ++i) path.idle(100ms);
  path.queue = 70ms;
  path.frames(30, 20);
  EXPECT_DOUBLE_EQ(path.mbit(), 60) << "what it has come down to the capacity tells";
}

TEST(ShareControl, WhoIsOverloadedDrainsTheQueueHoweverSlowly) {
  Path path;
  path.overload(100);
  path.queue = 70ms;
  path.overload(400);
  EXPECT_LT(path.mbit(), 6);
  EXPECT_GE(path.control.window(), 4U * 1428U);
}

TEST(ShareControl, LossesCountOnlyWithAQueue) {
  for (const Duration queue : {0ms, 25ms}) {
    Path path;
    path.overload(100);
    path.queue = queue;
    for (int i = 0; i < 20; ++i) {
      path.now += 50ms;
      ShareControl::Report report = path.next();
      report.lost = 1;
      report.backlog = 50ms;
      path.control.report(path.now, report);
    }
    if (queue == 0ms) {
      EXPECT_DOUBLE_EQ(path.mbit(), 60);
    } else {
      EXPECT_LT(path.mbit(), 50);
    }
  }
}

// So many reports, 50 ms apart, each with a long train that arrives at the pipe's rate and with
// this share of its packets marked.
void mark(Path& path, int reports, double share, Duration backlog) {
  for (int i = 0; i < reports; ++i) {
    path.now += 50ms;
    ShareControl::Report report = path.next();
    report.train = train(60, 75);
    report.ect = 100;
    report.marked = static_cast<std::uint32_t>(std::lround(share * 100));
    report.backlog = backlog;
    report.held_back = true;
    path.control.report(path.now, report);
  }
}

// A queue for L4S is short, and tells of itself in every packet that waits.
TEST(ShareControl, MarksOfAShortQueueAreAnsweredInProportion) {
  double left[2];
  for (const int many : {0, 1}) {
    Path path;
    path.overload(100);
    mark(path, 100, 0, 50ms);
    path.queue = 1ms;
    mark(path, 1, many == 1 ? 1.0 : 0.1, 50ms);
    left[many] = path.mbit() / 60;
  }
  EXPECT_GT(left[0], left[1]);
  EXPECT_GT(left[0], 0.99);
  EXPECT_LT(left[1], 0.98);
}

TEST(ShareControl, MarksOfAShortQueueLeaveWhatArrives) {
  Path path;
  path.overload(100);
  path.queue = 1ms;
  mark(path, 100, 1, 50ms);
  EXPECT_NEAR(path.mbit(), 54, 1);
}

TEST(ShareControl, AMarkOfALongQueueCountsAsALoss) {
  Path path;
  path.overload(200);
  path.queue = 10ms;
  mark(path, 1, 0, 50ms);
  mark(path, 1, 0.01, 50ms);
  EXPECT_NEAR(path.mbit(), 48, 1);
}

// All that left before the rate fell was marked by the same queue.
TEST(ShareControl, OneQueueIsAnsweredOnce) {
  Path path;
  path.overload(200);
  path.queue = 10ms;
  mark(path, 1, 0, 50ms);
  mark(path, 1, 0.5, 50ms);
  const double once = path.mbit();
  ShareControl::Report report = path.next();
  report.ect = report.marked = 20;
  path.control.report(path.now += 49ms, report);
  path.control.report(path.now += 30ms, path.next());
  EXPECT_GE(path.mbit(), once);
}

TEST(ShareControl, WhatFalseMarksTookIsGivenBack) {
  Path path;
  path.overload(200);
  path.queue = 10ms;
  mark(path, 40, 1, 50ms);
  ASSERT_LT(path.mbit(), 30);
  path.control.marks_were_false();
  EXPECT_DOUBLE_EQ(path.mbit(), 60);
  ShareControl nothing;
  nothing.marks_were_false();
  EXPECT_FALSE(nothing.rate());
}

// What is aimed at must fit the buffer, or every round trip ends in losses.
TEST(ShareControl, ABufferShorterThanTheTargetIsNotOverflowedForEver) {
  Path path;
  path.overload(200);
  const std::size_t usual = path.control.window();
  path.queue = 25ms;
  path.overload(20);
  ShareControl::Report report = path.next();
  report.lost = 3;
  report.held_back = true;
  report.backlog = 5ms;
  path.control.report(path.now += 5ms, report);
  path.overload(20);
  const double rate = path.mbit() / 60;
  const double seconds = static_cast<double>(path.control.window()) / (60e6 * rate / 8);
  EXPECT_LT(seconds, 0.065) << "a round trip of 40 ms and less than 25 ms of queue";
  EXPECT_LT(path.control.window(), usual);
}

// Messages of a few packets leave at once and show no stretch.
TEST(ShareControl, SmallMessagesSlowDownButNotBelowTheirDeadline) {
  Path path;
  path.idle(100ms);
  path.queue = 100ms;
  for (int i = 0; i < 50; ++i) {
    path.now += 100ms;
    ShareControl::Report report = path.next();
    report.train = train(60, 75, 6);
    report.needed = DataRate::mbit(1.2);
    path.control.report(path.now, report);
  }
  EXPECT_DOUBLE_EQ(path.mbit(), 1.2);
}

TEST(ShareControl, WhatWasGivenUpComesBackWhereNobodyIsInTheWay) {
  Path path;
  path.overload(50);
  path.queue = 70ms;
  path.overload(100);
  ASSERT_LT(path.mbit(), 30);
  path.queue = 0ms;
  Path idle = path;
  for (int i = 0; i < 20; ++i) idle.idle(100ms);
  EXPECT_DOUBLE_EQ(idle.mbit(), 60) << "at once, where nothing waits either";
  path.overload(800);
  EXPECT_GT(path.mbit(), 55);
}

// Where a message is withheld because the share is too small for it, nothing is sent that could
// show otherwise.
TEST(ShareControl, AnUnusedShareIsForgotten) {
  Path path;
  path.overload(200);
  path.queue = 70ms;
  path.overload(200);
  ASSERT_LT(path.mbit(), 30);
  for (int i = 0; i < 80; ++i) {
    ShareControl::Report nothing;
    nothing.capacity = kPipe;
    path.control.report(path.now += 50ms, nothing);
  }
  EXPECT_DOUBLE_EQ(path.mbit(), 60);
}

TEST(ShareControl, TheShareNeverFallsToNothing) {
  Path path;
  path.queue = 0ms;
  path.overload(200);
  path.queue = 300ms;
  path.overload(1500);
  EXPECT_GE(path.mbit(), 0.1);
}

// The same queue is seen by all; from any shares, equal increases and proportional decreases lead
// to equal shares (Chiu and Jain).
TEST(ShareControl, SharesOfOnePipeBecomeEqual) {
  std::vector<Path> paths(4);
  for (Path& path : paths) path.overload(10);
  // One came late and knows of no less than the whole pipe; the others have given way already.
  for (std::size_t i = 1; i < paths.size(); ++i) {
    paths[i].queue = 70ms;
    paths[i].overload(300);
    paths[i].queue = 0ms;
  }
  double queue_ms = 0;
  for (int step = 0; step < 12'000; ++step) {
    double sum = 0;
    for (const Path& path : paths) sum += path.mbit();
    queue_ms = std::clamp(queue_ms + 5 * (sum / 60 - 1), 0.0, 300.0);
    for (Path& path : paths) {
      path.queue = Duration{static_cast<std::int64_t>(queue_ms * 1e6)};
      path.overload(1);
    }
  }
  std::vector<double> shares;
  for (const Path& path : paths) shares.push_back(path.mbit());
  EXPECT_GT(*std::ranges::min_element(shares), 0.75 * *std::ranges::max_element(shares));
  EXPECT_LT(queue_ms, 60);
}

// A sender that never pauses would take its own queue for the path's length.
TEST(ShareControl, ASenderThatNeverPausesLetsThePathRunEmptyAtTimes) {
  Path path;
  path.overload(100);
  path.queue = 20ms;
  const std::size_t usual = path.control.window();
  std::size_t least = usual;
  for (int i = 0; i < 1000; ++i) {
    path.overload(1);
    least = std::min(least, path.control.window());
  }
  EXPECT_LT(least, usual / 2);
}

TEST(ShareControl, AClockThatSteppedIsNoQueue) {
  Path path;
  path.overload(100);
  path.control.clock_stepped();
  path.now += 5ms;
  ShareControl::Report report = path.next();
  report.one_way_us = 4'000'000'000U;
  report.held_back = true;
  report.backlog = 5ms;
  path.control.report(path.now, report);
  path.control.report(path.now += 100ms, report);
  EXPECT_DOUBLE_EQ(path.mbit(), 60);
}

TEST(ShareControl, NorIsAStepThatNobodyHasSaidWasOne) {
  Path path;
  path.overload(100);
  for (int i = 0; i < 20; ++i) {
    path.now += 5ms;
    ShareControl::Report report = path.next();
    *report.one_way_us += 600'000'000U;
    report.held_back = true;
    report.backlog = 5ms;
    path.control.report(path.now, report);
  }
  EXPECT_DOUBLE_EQ(path.mbit(), 60);
}

RC_GTEST_PROP(ShareControl, AnyReportLeavesARateWithinThePipe, ()) {
  ShareControl control;
  TimePoint now{1s};
  for (int i = 0; i < 100; ++i) {
    now += std::chrono::microseconds(*rc::gen::inRange(0, 200'000));
    ShareControl::Report report;
    if (*rc::gen::arbitrary<bool>()) {
      report.round_trip = std::chrono::microseconds(*rc::gen::inRange(0, 5'000'000));
    }
    if (*rc::gen::arbitrary<bool>()) report.one_way_us = *rc::gen::arbitrary<std::uint32_t>();
    if (*rc::gen::arbitrary<bool>()) {
      report.train = {*rc::gen::inRange<std::uint32_t>(0, 1000),
                      DataRate{*rc::gen::inRange<std::int64_t>(0, 2'000'000'000)},
                      DataRate{*rc::gen::inRange<std::int64_t>(0, 2'000'000'000)}};
    }
    report.capacity = DataRate{*rc::gen::inRange<std::int64_t>(1000, 2'000'000'000)};
    report.lost = *rc::gen::inRange<std::uint32_t>(0, 100);
    report.ect = *rc::gen::inRange<std::uint32_t>(0, 100);
    report.marked = *rc::gen::inRange<std::uint32_t>(0, report.ect + 1);
    report.held_back = *rc::gen::arbitrary<bool>();
    report.backlog = std::chrono::microseconds(*rc::gen::inRange(0, 200'000));
    control.report(now, report);
    RC_ASSERT(control.rate()->bits_per_second >= 0);
    RC_ASSERT(control.rate()->bits_per_second <= 2 * report.capacity->bits_per_second);
    RC_ASSERT(control.window() >= 4U * 1428U);
  }
}

}  // namespace
}  // namespace interneuron::cc::share_control_test
