#include "app/perception/motion.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <utility>
#include <vector>

#include "app/perception/detector.h"
#include "support.h"

namespace interneuron::perception::motion_streams_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration t) { return TimePoint{t}; }

// Frame `frame` of `sender`, with a dark figure that walks where `from` says, or without.
Image image_of(std::uint32_t sender, std::uint32_t frame, int from, bool walker = true,
               Variant variant = Variant::kSampled) {
  cv::Mat picture = scene(sender + 1);
  if (walker) {
    picture(cv::Rect(from + 8 * static_cast<int>(frame % 40), 250, 30, 75))
        .setTo(cv::Scalar(15, 15, 15));
  }
  Image image = make_variant(picture, frame, variant);
  image.sender = sender;
  return image;
}

Image small(std::uint32_t sender, int width) {
  return Image{.bgr = cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(7)),
               .source = cv::Size(width, 8),
               .sender = sender};
}

TEST(MotionStreams, AnEmptyStreetIsToldOfNobodyElse) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  bool seen = false;
  for (std::uint32_t frame = 0; frame < 25; ++frame) {
    // Both number their frames alike.
    const Image empty = image_of(2, frame, 0, false);
    seen = !ladder.detect(0, image_of(1, frame, 100)).empty() || seen;
    EXPECT_TRUE(ladder.detect(0, empty).empty()) << frame;
  }
  EXPECT_TRUE(seen);
}

TEST(MotionStreams, RawAndSampledAreOneStream) {
  MotionStreams streams;
  streams.mask(image_of(1, 0, 0, true, Variant::kRaw), at(0ms));
  streams.mask(image_of(1, 1, 0, true, Variant::kSampled), at(0ms));
  EXPECT_EQ(streams.size(), 1u);
  streams.mask(image_of(1, 2, 0, true, Variant::kGrey), at(0ms));
  EXPECT_EQ(streams.size(), 2u);
}

TEST(MotionStreams, ASenderOfManyFormsTakesNothingFromOthers) {
  MotionStreams streams;
  for (std::uint32_t sender = 1; sender < MotionStreams::kMaxStreams; ++sender) {
    for (int n = 0; n < 2; ++n) streams.mask(small(sender, 8), at(1ms * n));
  }
  for (int width = 1; width <= 100; ++width) streams.mask(small(0, width), at(1s));
  EXPECT_EQ(streams.size(), MotionStreams::kMaxStreams);
  // Whoever was there still is: no model is made for it anew.
  for (std::uint32_t sender = 1; sender < MotionStreams::kMaxStreams; ++sender) {
    streams.mask(small(sender, 8), at(2s));
    EXPECT_EQ(streams.size(), MotionStreams::kMaxStreams);
  }
  // The sender of many forms kept its newest, and has room for one more model only where it has
  // one to give.
  streams.mask(small(0, 101), at(3s));
  EXPECT_EQ(streams.size(), MotionStreams::kMaxStreams);
}

TEST(MotionStreams, ASenderHasItsNewestStreams) {
  MotionStreams streams;
  for (int width = 1; width <= 10; ++width) streams.mask(small(1, width), at(1ms * width));
  EXPECT_EQ(streams.size(), MotionStreams::kMaxPerSender);
}

TEST(MotionStreams, WhatIsNotUsedIsForgotten) {
  MotionStreams streams;
  streams.mask(small(1, 8), at(0ms));
  streams.mask(small(2, 8), at(10s));
  EXPECT_EQ(streams.size(), 2u);
  streams.mask(small(2, 8), at(MotionStreams::kLifetime));
  EXPECT_EQ(streams.size(), 2u);
  streams.mask(small(2, 8), at(MotionStreams::kLifetime + 1ns));
  EXPECT_EQ(streams.size(), 1u);
}

TEST(MotionStreams, ASenderThatIsGoneIsForgotten) {
  MotionStreams streams;
  streams.mask(small(1, 8), at(0ms));
  streams.mask(small(1, 9), at(0ms));
  streams.mask(small(2, 8), at(0ms));
  streams.forget(1);
  EXPECT_EQ(streams.size(), 1u);
  streams.reset();
  EXPECT_EQ(streams.size(), 0u);
}

// One vehicle's images alone, and among those of another that does what it likes: the same boxes.
RC_GTEST_PROP(MotionStreams, WhatOneVehicleIsToldDoesNotDependOnAnothersFrames, ()) {
  Ladder alone = make_ladder({.kind = LadderKind::kMotion});
  Ladder shared = make_ladder({.kind = LadderKind::kMotion});
  const auto level = *rc::gen::inRange<std::size_t>(0, 3);
  const auto frames = *rc::gen::inRange<std::uint32_t>(4, 12);
  for (std::uint32_t frame = 0; frame < frames; ++frame) {
    const auto disturbances = *rc::gen::container<std::vector<std::pair<int, int>>>(
        *rc::gen::inRange<std::size_t>(0, 3),
        rc::gen::pair(rc::gen::inRange(0, 12), rc::gen::inRange(0, 4)));
    for (const auto& [number, form] : disturbances) {
      Image other = image_of(2, static_cast<std::uint32_t>(number), 300, true,
                             form % 2 == 0 ? Variant::kSampled : Variant::kGrey);
      if (form > 1) other.source.width += number;
      (void)shared.detect(static_cast<std::size_t>(form) % 3, other);
    }
    const Image image = image_of(1, frame, 100);
    RC_ASSERT(alone.detect(level, image) == shared.detect(level, image));
  }
}

}  // namespace
}  // namespace interneuron::perception::motion_streams_test
