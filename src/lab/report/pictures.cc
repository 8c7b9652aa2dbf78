#include "lab/report/page.h"

#include <opencv2/imgcodecs.hpp>

#include "app/perception/frame_source.h"
#include "app/perception/picture.h"
#include "app/process/failure.h"
#include "app/settings/data.h"
#include "lab/eval/experiments/scorer.h"

namespace interneuron::report {
namespace {

// This frame shows many people, some of them hidden.
constexpr std::uint32_t kFrame = 150;
// Most of its people are here, so that their boxes can be told apart on a small screen.
constexpr int kLeft = 290;
constexpr int kTop = 40;
constexpr int kWidth = 470;
constexpr int kHeight = 320;

struct Shot {
  const char* caption;
  std::size_t level;
  bool sampled;
  std::uint32_t age;
};
constexpr Shot kShots[] = {{"on time: remote result, best level, raw image", 2, false, 0},
                           {"sacrificed: remote result, lighter model, sampled image", 1, true, 0},
                           {"missed: fresh local backup, lowest level", 0, false, 0},
                           {"missed: last remote result, two rounds old", 2, false, 2}};

std::string png_of(const cv::Mat& picture) {
  const cv::Rect whole(0, 0, picture.cols, picture.rows);
  const cv::Mat shown = picture(cv::Rect(kLeft, kTop, kWidth, kHeight) & whole);
  std::vector<unsigned char> png;
  cv::imencode(".png", shown, png);
  return {png.begin(), png.end()};
}

}  // namespace

std::vector<Picture> pictures(const std::optional<std::filesystem::path>& data, bool named,
                              std::string& missing) {
  const experiments::Scorer scorer(data, named);
  missing = scorer.missing();
  if (!missing.empty()) return {};
  std::vector<Picture> out;
  try {
    perception::FrameSource source(settings::default_video(data));
    std::optional<perception::Frame> frame;
    for (std::uint32_t i = 0; i <= kFrame; ++i) frame = source.next();
    if (!frame) {
      missing = "the video is too short";
      return {};
    }
    for (const Shot& shot : kShots) {
      const auto boxes = scorer.boxes(shot.level, shot.sampled, kFrame - shot.age);
      out.push_back(
          {shot.caption, png_of(perception::draw_boxes(frame->bgr, boxes, shot.caption))});
    }
  } catch (const process::Failure& error) {
    missing = error.what();
  } catch (const perception::InputError& error) {
    missing = error.what();
  }
  return out;
}

}  // namespace interneuron::report
