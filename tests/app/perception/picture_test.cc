#include "app/perception/picture.h"

#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "support.h"

namespace interneuron::perception::picture_test {
namespace {

bool differs(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) > 0; }

TEST(Picture, ShowsBoxesAndACaptionBelow) {
  const cv::Mat frame = scene();
  const std::vector<Box> boxes = {{100, 100, 50, 120, 0.9F}};
  const cv::Mat picture = draw_boxes(frame, boxes, "round 12: remote, 87 ms");
  EXPECT_EQ(picture.cols, frame.cols);
  EXPECT_GT(picture.rows, frame.rows);
  EXPECT_TRUE(differs(picture.rowRange(0, frame.rows), frame));
  const cv::Mat plain = draw_boxes(frame, {}, "");
  EXPECT_FALSE(differs(plain.rowRange(0, frame.rows), frame));
  EXPECT_TRUE(
      differs(plain.rowRange(frame.rows, plain.rows), picture.rowRange(frame.rows, plain.rows)));
}

TEST(Picture, LeavesOutWeakBoxes) {
  const std::vector<Box> boxes = {{100, 100, 50, 120, 0.2F}};
  EXPECT_FALSE(differs(draw_boxes(scene(), boxes, "x", 0.3F), draw_boxes(scene(), {}, "x")));
  EXPECT_TRUE(differs(draw_boxes(scene(), boxes, "x", 0.1F), draw_boxes(scene(), {}, "x")));
}

TEST(Picture, WrapsALongCaption) {
  const cv::Mat one = draw_boxes(scene(), {}, "short");
  const cv::Mat two = draw_boxes(scene(), {}, std::string(150, 'x'));
  const cv::Mat lines = draw_boxes(scene(), {}, "a\nb");
  EXPECT_GT(two.rows, one.rows);
  EXPECT_EQ(lines.rows, two.rows);
}

TEST(Picture, TakesBoxesFromAnywhere) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const std::vector<Box> boxes = {
      {-1e9F, -1e9F, 3e9F, 3e9F, 1}, {kNan, kInf, -kInf, kNan, 1}, {-5, -5, 0, 0, 1}};
  EXPECT_FALSE(draw_boxes(scene(), boxes, "anything").empty());
}

TEST(Picture, IsEncodedAsPng) {
  const std::vector<Box> boxes{{1, 2, 3, 4, 0.5F}};
  const std::string png = png_picture(scene(), boxes, "caption");
  const cv::Mat back = cv::imdecode(std::vector<char>(png.begin(), png.end()), cv::IMREAD_COLOR);
  EXPECT_FALSE(differs(back, draw_boxes(scene(), boxes, "caption")));
}

}  // namespace
}  // namespace interneuron::perception::picture_test
