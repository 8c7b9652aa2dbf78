#include <vector>

#include "app/perception/detector.h"
#include "app/perception/motion.h"
#include "support.h"

namespace interneuron::perception::motion_test {
namespace {

constexpr int kWalkerWidth = 30;   // pixels of the source, a person of the demo video
constexpr int kWalkerHeight = 75;  // pixels

cv::Rect walker_at(int frame) { return {100 + 8 * frame, 250, kWalkerWidth, kWalkerHeight}; }

// A dark figure that walks through a still scene.
cv::Mat walk(int frame) {
  cv::Mat picture = scene();
  picture(walker_at(frame)).setTo(cv::Scalar(15, 15, 15));
  return picture;
}

Box truth_at(int frame) {
  const cv::Rect r = walker_at(frame);
  return {static_cast<float>(r.x), static_cast<float>(r.y), static_cast<float>(r.width),
          static_cast<float>(r.height), 0};
}

double best_iou(const std::vector<Box>& boxes, int frame) {
  double best = 0;
  for (const Box& box : boxes) best = std::max(best, iou(box, truth_at(frame)));
  return best;
}

Image image_of(const cv::Mat& bgr, int frame, Variant variant = Variant::kRaw) {
  return make_variant(bgr, static_cast<std::uint32_t>(frame), variant);
}

bool same(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) == 0; }

TEST(Motion, FindsWhatWalks) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  int found = 0;
  constexpr int kEmpty =
      10;  // frames of the scene alone: a walker in the first would leave a ghost
  constexpr int kFrames = 50;
  for (int frame = 0; frame < kFrames; ++frame) {
    // Either variant may arrive, round by round.
    const Variant variant = frame % 3 == 0 ? Variant::kSampled : Variant::kRaw;
    const auto boxes =
        ladder.detect(0, image_of(frame < kEmpty ? scene() : walk(frame), frame, variant));
    found += best_iou(boxes, frame) >= 0.5 ? 1 : 0;
    for (const Box& box : boxes) EXPECT_TRUE(box.score >= 0 && box.score <= 1);
  }
  EXPECT_GE(found, kFrames - kEmpty - 5);
}

TEST(Motion, FirstFramesShowNobody) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  for (std::size_t level = 0; level + 1 < ladder.size(); ++level) {
    ladder.level(level).detector->reset();
    EXPECT_TRUE(ladder.detect(level, image_of(scene(), 0)).empty());
    EXPECT_TRUE(ladder.detect(level, image_of(scene(), 1)).empty());
  }
}

TEST(Motion, AStillSceneShowsNobody) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  for (int frame = 0; frame < 20; ++frame) {
    EXPECT_TRUE(
        ladder.detect(static_cast<std::size_t>(frame % 3), image_of(scene(), frame)).empty());
  }
}

TEST(Motion, BoxesAreInPixelsOfTheSource) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  std::vector<Box> boxes;
  constexpr int kLast = 20;
  for (int frame = 0; frame <= kLast; ++frame) {
    Image image = image_of(walk(frame), frame);
    image.source = {1536, 1152};
    boxes = ladder.detect(0, image);
  }
  for (Box& b : boxes) b = {b.x / 2, b.y / 2, b.w / 2, b.h / 2, b.score};
  EXPECT_GE(best_iou(boxes, kLast), 0.5);
}

TEST(Motion, ALevelThatStepsInKnowsTheBackground) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  for (int frame = 0; frame < 20; ++frame) ladder.detect(1, image_of(walk(frame), frame));
  EXPECT_GE(best_iou(ladder.detect(0, image_of(walk(20), 20)), 20), 0.5);
}

TEST(Motion, ACameraThatMovesStaysBounded) {
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  for (int frame = 0; frame < 6; ++frame) {
    for (std::size_t level = 0; level < ladder.size(); ++level) {
      const auto number = static_cast<std::uint64_t>(frame * 10) + level;
      EXPECT_LE(ladder.detect(level, image_of(scene(number + 1), static_cast<int>(number))).size(),
                kMaxBoxes);
    }
  }
}

TEST(MotionModel, LearnsOnceFromAFrame) {
  MotionModel once;
  MotionModel often;
  for (int frame = 0; frame < 15; ++frame) {
    const Image image = image_of(walk(frame), frame);
    once.mask(image);
    for (int n = 0; n < 3; ++n) often.mask(image);
    ASSERT_TRUE(same(once.mask(image), often.mask(image))) << frame;
  }
  EXPECT_GT(cv::countNonZero(once.mask(image_of(walk(15), 15))), 0);
}

TEST(MotionModel, SeesRawAndSampledAlike) {
  MotionModel raw;
  MotionModel sampled;
  for (int frame = 0; frame < 15; ++frame) {
    const cv::Mat seen = raw.mask(image_of(walk(frame), frame, Variant::kRaw));
    ASSERT_TRUE(same(seen, sampled.mask(image_of(walk(frame), frame, Variant::kSampled)))) << frame;
  }
}

TEST(MotionModel, TakesPicturesOfAnySize) {
  MotionModel model;
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2000, 3), cv::Size(768, 576)}) {
    Image image{.bgr = cv::Mat(size, CV_8UC3, cv::Scalar::all(7)),
                .frame = static_cast<std::uint32_t>(size.width)};
    EXPECT_EQ(model.mask(image).size(), cv::Size(kSampledWidth, kSampledHeight));
  }
}

TEST(MotionModel, ResetForgets) {
  MotionModel model;
  for (int frame = 0; frame < 10; ++frame) model.mask(image_of(walk(frame), frame));
  model.reset();
  EXPECT_EQ(cv::countNonZero(model.mask(image_of(walk(10), 10))), 0);
}

}  // namespace
}  // namespace interneuron::perception::motion_test
