#include "core/cc/crowd_share.h"

#include <gtest/gtest.h>

namespace interneuron::cc::crowd_share_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRoundTrip = 40ms;
constexpr std::size_t kFrame = 30'000;
constexpr std::size_t kSmall = 7'500;

// A camera at 10 Hz over a cell of 60 Mbit/s, whose queue is told of by small packets every 50 ms.
struct Camera {
  CrowdShare share;
  TimePoint now{1h};
  Duration queue{};
  bool stretched = false;
  int granted = 0;

  Camera() { share.set_capacity(DataRate::mbit(60)); }
  void frame(std::size_t smallest = kSmall) {
    share.asked(now, kFrame, smallest, 130ms);
    const bool whole =
        share.is_crowded() ? share.planned() >= rate_of(kFrame, 130ms) : !share.is_held_low();
    granted += whole ? 1 : 0;
    share.sent(now, whole ? kFrame : smallest < kFrame ? smallest : 0);
    if (stretched) share.stretched(now);
    for (int half = 0; half < 2; ++half) {
      now += 50ms;
      share.met(now, now - kRoundTrip, queue);
      share.decide(now, kRoundTrip);
    }
  }
  void frames(int count) {
    for (int i = 0; i < count; ++i) frame();
  }
  // Others fill the queue within three frames.
  void crowd() {
    stretched = true;
    for (const Duration waits : {20ms, 60ms, 90ms}) {
      queue = waits;
      frame();
    }
  }
};

TEST(CrowdShare, WhereNobodyElseIsThePipeIsNotShared) {
  Camera camera;
  camera.frames(50);
  EXPECT_FALSE(camera.share.is_crowded());
  EXPECT_EQ(camera.granted, 50);
}

// What waits is not its own, but too little to convict anybody.
TEST(CrowdShare, WhoHasJustBegunHoldsItsBestBackBehindOthers) {
  for (const bool is_new : {true, false}) {
    Camera camera;
    camera.frames(is_new ? 5 : 50);
    camera.granted = 0;
    camera.stretched = true;
    camera.queue = 25ms;
    camera.frames(2);
    EXPECT_FALSE(camera.share.is_crowded());
    EXPECT_EQ(camera.granted, is_new ? 1 : 2);
    camera.queue = 0ms;
    camera.frames(20);
    EXPECT_EQ(camera.granted, is_new ? 20 : 22);
  }
}

// Its packets waited before there were messages. With nothing smaller to send it sends what it has.
TEST(CrowdShare, WhoMetOthersBeforeItsFirstMessageBeginsLow) {
  for (const std::size_t smallest : {kSmall, kFrame}) {
    Camera camera;
    camera.queue = 0ms;
    for (int i = 0; i < 4; ++i) {
      camera.now += 50ms;
      camera.share.met(camera.now, camera.now - kRoundTrip, i == 2 ? Duration(4ms) : Duration(0ms));
    }
    camera.frame(smallest);
    EXPECT_EQ(camera.granted, smallest < kFrame ? 0 : 1);
    camera.frames(10);
    EXPECT_GE(camera.granted, 8);
  }
}

// Whoever has just begun needs less evidence: a queue longer than radio makes, with no train.
TEST(CrowdShare, WhoBeginsInACrowdFindsItSooner) {
  for (const bool is_new : {true, false}) {
    Camera camera;
    camera.frames(is_new ? 5 : 50);
    for (const Duration waits : {30ms, 60ms, 90ms}) {
      camera.queue = waits;
      camera.frame();
    }
    EXPECT_EQ(camera.share.is_crowded(), is_new);
  }
}

TEST(CrowdShare, AQueueOfOthersTakesHalfOfWhatIsUsed) {
  Camera camera;
  camera.frames(50);
  camera.crowd();
  ASSERT_TRUE(camera.share.is_crowded());
  EXPECT_LT(camera.share.rate().mbit(), 2.4);
  EXPECT_GE(camera.share.rate().mbit(), 0.6) << "the smallest variants go on";
}

// Radio is late at once and on time at once.
TEST(CrowdShare, ADelayThatComesAtOnceIsNoQueue) {
  Camera camera;
  camera.frames(50);
  camera.stretched = true;
  camera.queue = 400ms;
  camera.frames(5);
  EXPECT_FALSE(camera.share.is_crowded());
}

// What the share leaves of frames goes as whole ones at times, and as small ones between them.
TEST(CrowdShare, WhatIsSavedUpIsSpentOnWholeFrames) {
  Camera camera;
  camera.frames(50);
  camera.crowd();
  camera.queue = 15ms;
  camera.granted = 0;
  camera.frames(100);
  ASSERT_TRUE(camera.share.is_crowded());
  EXPECT_GT(camera.granted, 20);
  EXPECT_LT(camera.granted, 95);
}

TEST(CrowdShare, WhereOthersAreGoneItIsSharedNoMore) {
  Camera camera;
  camera.frames(50);
  camera.crowd();
  ASSERT_TRUE(camera.share.is_crowded());
  camera.queue = 0ms;
  camera.frames(150);
  EXPECT_FALSE(camera.share.is_crowded());
}

// At a queue that all see the small share grows and the large one shrinks.
TEST(CrowdShare, SharesOfOneQueueBecomeEqual) {
  Camera few;
  Camera many;
  for (Camera* camera : {&few, &many}) {
    camera->frames(50);
    camera->crowd();
  }
  few.queue = 60ms;
  few.frames(6);
  ASSERT_LT(few.share.rate(), many.share.rate());
  const double before = few.share.rate().mbit() / many.share.rate().mbit();
  for (Camera* camera : {&few, &many}) {
    for (int i = 0; i < 100; ++i) {
      camera->queue = i % 2 == 0 ? 20ms : 32ms;
      camera->frame();
    }
  }
  ASSERT_TRUE(few.share.is_crowded() && many.share.is_crowded());
  EXPECT_GT(few.share.rate().mbit() / many.share.rate().mbit(), before);
}

}  // namespace
}  // namespace interneuron::cc::crowd_share_test
