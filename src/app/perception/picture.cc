#include "app/perception/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace interneuron::perception {
namespace {

// Colours are blue, green, red. Green shows on asphalt.
const cv::Scalar kBoxColour(60, 220, 60);
const cv::Scalar kTextColour(255, 255, 255);
const cv::Scalar kStripColour(40, 40, 40);
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
// The size of scores, as a share of the font's 22 pixels.
constexpr double kScoreScale = 0.4;
constexpr double kCaptionScale = 0.5;
// The caption's line height and margin, in pixels.
constexpr int kLineHeight = 22;
constexpr int kMargin = 6;

// Cuts the caption into lines that fit.
std::vector<std::string> wrap(const std::string& caption, int width) {
  std::vector<std::string> lines(1);
  for (const char c : caption) {
    const int used = cv::getTextSize(lines.back() + c, kFont, kCaptionScale, 1, nullptr).width;
    if (c == '\n' || (used > width - 2 * kMargin && !lines.back().empty())) lines.emplace_back();
    if (c != '\n') lines.back() += c;
  }
  return lines;
}

void draw_box(cv::Mat& picture, const Box& box) {
  // A peer's box may lie anywhere; keep the arithmetic of the drawing far from overflow.
  constexpr float kFar = 1e5F;
  const auto pixel = [kFar](float v) {
    return std::isfinite(v) ? static_cast<int>(std::lround(std::clamp(v, -kFar, kFar))) : 0;
  };
  const cv::Point from(pixel(box.x), pixel(box.y));
  const cv::Point to(pixel(box.x + box.w), pixel(box.y + box.h));
  cv::rectangle(picture, from, to, kBoxColour, 1, cv::LINE_8);
  char score[16];
  std::snprintf(score, sizeof score, "%.2f", static_cast<double>(box.score));
  cv::putText(picture, score, {from.x, std::max(from.y - 3, 9)}, kFont, kScoreScale, kBoxColour, 1,
              cv::LINE_AA);
}

}  // namespace

cv::Mat draw_boxes(const cv::Mat& bgr, std::span<const Box> boxes, const std::string& caption,
                   float min_score) {
  const std::vector<std::string> lines = wrap(caption, bgr.cols);
  const int strip = static_cast<int>(lines.size()) * kLineHeight + kMargin;
  cv::Mat picture(bgr.rows + strip, bgr.cols, CV_8UC3, kStripColour);
  cv::Mat frame = picture.rowRange(0, bgr.rows);
  bgr.copyTo(frame);
  for (const Box& box : boxes) {
    if (box.score >= min_score) draw_box(frame, box);
  }
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const int baseline = bgr.rows + static_cast<int>(i + 1) * kLineHeight - kMargin / 2;
    cv::putText(picture, lines[i], {kMargin, baseline}, kFont, kCaptionScale, kTextColour, 1,
                cv::LINE_AA);
  }
  return picture;
}

std::string png_picture(const cv::Mat& bgr, std::span<const Box> boxes, const std::string& caption,
                        float min_score) {
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", draw_boxes(bgr, boxes, caption, min_score), png)) {
    throw InputError("a picture of a frame: cannot be encoded as PNG");
  }
  return {png.begin(), png.end()};
}

}  // namespace interneuron::perception
