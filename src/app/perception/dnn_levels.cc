// Neural detectors on OpenCV's dnn module. One net per level, since a net that changes its input
// size allocates anew.
#include <algorithm>
#include <cmath>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "app/perception/openable.h"

#include "app/perception/levels.h"

namespace interneuron::perception {
namespace {

namespace fs = std::filesystem;

// Boxes scored lower are dropped: they gain no AP on the demo video, and its recorded boxes end
// there too.
constexpr float kMinScore = 0.02F;
// Where two boxes overlap by more, only the better one stays; the usual bound for pedestrians.
constexpr float kMaxIou = 0.5F;
// A candidate is a row of values: 4 of the box, the objectness, 80 classes of COCO, of which class
// 0, person, is in column kPerson.
constexpr int kValues = 85;
constexpr int kPerson = 5;

const char* const kYoloFastestCfg = "models/yolo-fastest-1.1.cfg";
const char* const kYoloFastestWeights = "models/yolo-fastest-1.1.weights";
const char* const kYoloxNano = "models/yolox_nano.onnx";

// Boxes of an image of size `from`, in pixels of its source.
std::vector<Box> to_source(std::vector<Box> boxes, cv::Size from, cv::Size source) {
  const auto sx = static_cast<float>(source.width) / static_cast<float>(from.width);
  const auto sy = static_cast<float>(source.height) / static_cast<float>(from.height);
  for (Box& box : boxes) {
    box = {.x = box.x * sx, .y = box.y * sy, .w = box.w * sx, .h = box.h * sy, .score = box.score};
  }
  return boxes;
}

// The pixels that a net was trained on.
struct Pixels {
  // By which values of 0 … 255 are multiplied.
  double scale;
  // Whether red comes first; blue otherwise.
  bool rgb;
};

class DnnDetector : public Detector {
 public:
  // Runs the net once, so that a model of another shape is found now and the first image is not
  // slow.
  DnnDetector(const fs::path& model, cv::dnn::Net net, cv::Size input, Pixels pixels)
      : net_(std::move(net)),
        input_(input),
        pixels_(pixels),
        outputs_(net_.getUnconnectedOutLayersNames()) {
    std::vector<cv::Mat> candidates;
    try {
      candidates = forward(cv::Mat(input_, CV_8UC3, cv::Scalar::all(0)));
    } catch (const cv::Exception& e) {
      throw bad_model(model, e.err);
    }
    for (const cv::Mat& rows : candidates) {
      if (rows.cols != kValues || rows.type() != CV_32F) throw bad_model(model, "other outputs");
    }
  }

  static InputError bad_model(const fs::path& model, const std::string& why) {
    return InputError("model '" + model.string() + "': not usable (" +
                      why.substr(0, why.find('\n')) + "); run scripts/fetch_data.sh");
  }

 protected:
  // The candidates for an image of the input's size, kValues columns each.
  std::vector<cv::Mat> forward(const cv::Mat& input) {
    net_.setInput(cv::dnn::blobFromImage(input, pixels_.scale, {}, {}, pixels_.rgb));
    std::vector<cv::Mat> out;
    net_.forward(out, outputs_);
    for (cv::Mat& mat : out) {
      if (mat.dims == 3 && mat.size[0] == 1) mat = mat.reshape(1, mat.size[1]);
    }
    return out;
  }
  cv::Size input() const { return input_; }

 private:
  cv::dnn::Net net_;
  cv::Size input_;
  Pixels pixels_;
  std::vector<std::string> outputs_;
};

// Darknet's YOLO: RGB in 0 … 1, stretched to the input; boxes as fractions of it; scores include
// the objectness.
class YoloFastest : public DnnDetector {
 public:
  YoloFastest(const fs::path& model, cv::dnn::Net net, cv::Size input)
      : DnnDetector(model, std::move(net), input, {1 / 255.0, true}) {}

  std::vector<Box> detect(const Image& image) override {
    cv::Mat resized;
    cv::resize(image.bgr, resized, input());
    std::vector<Box> boxes;
    const auto width = static_cast<float>(image.bgr.cols);
    const auto height = static_cast<float>(image.bgr.rows);
    for (const cv::Mat& candidates : forward(resized)) {
      for (int i = 0; i < candidates.rows; ++i) {
        const auto* c = candidates.ptr<float>(i);
        if (!(c[kPerson] >= kMinScore)) continue;
        boxes.push_back({.x = (c[0] - c[2] / 2) * width,
                         .y = (c[1] - c[3] / 2) * height,
                         .w = c[2] * width,
                         .h = c[3] * height,
                         .score = c[kPerson]});
      }
    }
    return to_source(suppress(std::move(boxes), kMaxIou, kMinScore), image.bgr.size(),
                     image.source);
  }
};

// YOLOX: BGR in 0 … 255, aspect kept, padded right and below; a candidate per cell of three grids,
// offsets in cells, sizes as logarithms (YOLOX, demo/ONNXRuntime).
class YoloxNano : public DnnDetector {
 public:
  YoloxNano(const fs::path& model, cv::dnn::Net net, cv::Size input)
      : DnnDetector(model, std::move(net), input, {1.0, false}) {}

  std::vector<Box> detect(const Image& image) override {
    const cv::Size size = image.bgr.size();
    const double ratio = std::min(static_cast<double>(input().width) / size.width,
                                  static_cast<double>(input().height) / size.height);
    const cv::Size scaled(std::max(1, static_cast<int>(size.width * ratio)),
                          std::max(1, static_cast<int>(size.height * ratio)));
    // YOLOX was trained with images padded by this grey value.
    constexpr int kPadding = 114;
    cv::Mat padded(input(), CV_8UC3, cv::Scalar::all(kPadding));
    cv::Mat part = padded(cv::Rect({0, 0}, scaled));
    cv::resize(image.bgr, part, scaled);
    std::vector<Box> boxes = decode(forward(padded).front(), static_cast<float>(ratio));
    return to_source(suppress(std::move(boxes), kMaxIou, kMinScore), size, image.source);
  }

 private:
  std::vector<Box> decode(const cv::Mat& candidates, float ratio) const {
    std::vector<Box> boxes;
    int i = 0;
    for (const int stride : {8, 16, 32}) {
      const float cell = static_cast<float>(stride) / ratio;
      for (int y = 0; y < input().height / stride; ++y) {
        for (int x = 0; x < input().width / stride && i < candidates.rows; ++x, ++i) {
          const auto* c = candidates.ptr<float>(i);
          const float score = c[4] * c[kPerson];
          if (!(score >= kMinScore)) continue;
          const float w = std::exp(c[2]) * cell;
          const float h = std::exp(c[3]) * cell;
          boxes.push_back({.x = (c[0] + static_cast<float>(x)) * cell - w / 2,
                           .y = (c[1] + static_cast<float>(y)) * cell - h / 2,
                           .w = w,
                           .h = h,
                           .score = score});
        }
      }
    }
    return boxes;
  }
};

void require(const fs::path& model) {
  std::error_code error;
  if (fs::is_regular_file(model, error)) return check_openable("model", model);
  throw InputError("model '" + model.string() + "': no such file; run scripts/fetch_data.sh");
}

std::string sized(const char* name, cv::Size input) {
  return std::string(name) + " " + std::to_string(input.width) + "x" + std::to_string(input.height);
}

Level yolo_fastest(const fs::path& data_dir, cv::Size input) {
  const fs::path cfg = data_dir / kYoloFastestCfg;
  const fs::path weights = data_dir / kYoloFastestWeights;
  require(cfg);
  require(weights);
  cv::dnn::Net net;
  try {
    net = cv::dnn::readNetFromDarknet(cfg.string(), weights.string());
  } catch (const cv::Exception& e) {
    throw DnnDetector::bad_model(weights, e.err);
  }
  return {.name = sized("yolo-fastest-1.1", input),
          .detector = std::make_shared<YoloFastest>(weights, std::move(net), input)};
}

Level yolox_nano(const fs::path& data_dir, cv::Size input) {
  const fs::path model = data_dir / kYoloxNano;
  require(model);
  cv::dnn::Net net;
  try {
    net = cv::dnn::readNetFromONNX(model.string());
  } catch (const cv::Exception& e) {
    throw DnnDetector::bad_model(model, e.err);
  }
  return {.name = sized("yolox-nano", input),
          .detector = std::make_shared<YoloxNano>(model, std::move(net), input)};
}

}  // namespace

std::vector<fs::path> missing_models(const fs::path& data_dir) {
  std::vector<fs::path> missing;
  for (const char* model : {kYoloFastestCfg, kYoloFastestWeights, kYoloxNano}) {
    std::error_code error;
    if (!fs::is_regular_file(data_dir / model, error)) missing.push_back(data_dir / model);
  }
  return missing;
}

std::vector<Level> dnn_levels(const fs::path& data_dir, std::size_t max_levels) {
  std::vector<Level> levels;
  levels.push_back(yolo_fastest(data_dir, {224, 224}));
  if (max_levels > 1) levels.push_back(yolox_nano(data_dir, {256, 192}));
  if (max_levels > 2) levels.push_back(yolox_nano(data_dir, {416, 320}));
  for (Level& level : levels) add_measured(data_dir, level);
  return levels;
}

}  // namespace interneuron::perception
