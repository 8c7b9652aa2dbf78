// Detectors that play back recorded boxes of the demo video, as
// <data>/detections/LEVEL__INPUT.csv.gz holds them, and let the recorded times of
// <data>/profile.csv pass: a run with real accuracies that needs no model and no computation.
#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "app/perception/openable.h"

#include "app/perception/levels.h"

namespace interneuron::perception {
namespace {

namespace fs = std::filesystem;

// The recordings were made of these inputs, and their boxes are in pixels of this source.
const char* const kRawInput = "raw484x361";
const char* const kSampledInput = "s2_242x181";
// Size of the demo video's frames, in pixels.
constexpr float kSourceWidth = 768;
constexpr float kSourceHeight = 576;
// Frames of a recording, which bounds the memory that a damaged one takes: 24 MB; a day of video at
// 10 frames a second has 864,000.
constexpr std::size_t kMaxFrames = 1'000'000;

// What was measured of a net on the demo video's 795 frames with motion_bench: AP (the recordings'
// own program gets the same on the paper's images; there are no recordings of JPEGs) and the score
// of the highest F1 by its recorded boxes, and how long an image took on one core.
struct Recorded {
  const char* recording;
  const char* name;
  double ap_raw;
  double ap_sampled;
  std::array<double, 4> ap_jpeg;
  float draw_score;
  double median_ms;
};
// The same three as the dnn ladder's.
constexpr std::array<Recorded, 3> kLevels = {{{"L0_yolofastest_224",
                                               "yolo-fastest-1.1 224x224",
                                               0.136,
                                               0.128,
                                               {0.139, 0.134, 0.136, 0.133},
                                               0.65F,
                                               7.5},
                                              {"L2_yoloxnano_256x192",
                                               "yolox-nano 256x192",
                                               0.348,
                                               0.327,
                                               {0.353, 0.348, 0.347, 0.335},
                                               0.4F,
                                               20.2},
                                              {"L4_yoloxnano_416x320",
                                               "yolox-nano 416x320",
                                               0.396,
                                               0.383,
                                               {0.397, 0.395, 0.394, 0.387},
                                               0.5F,
                                               50.9}}};

InputError bad(const char* kind, const fs::path& file, const std::string& what) {
  return InputError(
      std::string(kind) + " '" + file.string() + "': " + what +
      "; --data must name a folder with detections/ and profile.csv, or use another ladder");
}

// A whole file, unpacked.
std::string read_gz(const fs::path& file) {
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> in(gzopen(file.c_str(), "rb"), gzclose);
  if (!in) check_openable("recording", file);
  if (!in) throw bad("recording", file, "no such file");
  std::string text;
  std::array<char, 1 << 16> chunk{};
  while (true) {
    const int got = gzread(in.get(), chunk.data(), static_cast<unsigned>(chunk.size()));
    if (got > 0) text.append(chunk.data(), static_cast<std::size_t>(got));
    if (got < static_cast<int>(chunk.size())) break;
  }
  int error = Z_OK;
  (void)gzerror(in.get(), &error);
  if (error != Z_OK) throw bad("recording", file, "damaged");
  return text;
}

// Cuts off and returns what comes before the next `separator`.
std::string_view cut(std::string_view& text, char separator) {
  const std::size_t at = text.find(separator);
  const std::string_view head = text.substr(0, at);
  text.remove_prefix(at == std::string_view::npos ? text.size() : at + 1);
  return head;
}

template <class T>
bool parse(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

// [0-based frame] -> its boxes.
using Recording = std::vector<std::vector<Box>>;

Recording read_recording(const fs::path& file) {
  const std::string text = read_gz(file);
  std::string_view rest = text;
  if (cut(rest, '\n') != "frame,x,y,w,h,score") throw bad("recording", file, "another format");
  Recording recording;
  for (int number = 2; !rest.empty(); ++number) {
    std::string_view line = cut(rest, '\n');
    // The file counts frames from 1.
    std::size_t frame = 0;
    Box box;
    const bool good = parse(cut(line, ','), frame) && parse(cut(line, ','), box.x) &&
                      parse(cut(line, ','), box.y) && parse(cut(line, ','), box.w) &&
                      parse(cut(line, ','), box.h) && parse(line, box.score);
    if (!good || frame < 1 || frame > kMaxFrames) {
      throw bad("recording", file,
                "line " + std::to_string(number) + " is not 'frame,x,y,w,h,score'");
    }
    if (recording.size() < frame) recording.resize(frame);
    recording[frame - 1].push_back(box);
  }
  for (auto& boxes : recording)
    boxes = suppress(std::move(boxes), 1.0F, 0.0F);  // in order, at most kMaxBoxes
  return recording;
}

struct Profiled {
  double ap = 0;
  Duration median{};
  Duration p95{};
};

Profiled read_profile(const fs::path& file, std::string_view recording, std::string_view input) {
  std::ifstream in(file);
  if (!in) check_openable("profile", file);
  if (!in) throw bad("profile", file, "no such file");
  std::string header;
  std::getline(in, header);
  if (header != "level,input,bytes_rgb,AP,AP50,AR,R50,t1_p50_ms,t1_p95_ms,t1_p99_ms,t1_max_ms") {
    throw bad("profile", file, "another format");
  }
  for (std::string line; std::getline(in, line);) {
    std::string_view rest = line;
    if (cut(rest, ',') != recording || cut(rest, ',') != input) continue;
    cut(rest, ',');  // bytes
    double ap = 0;
    double median = 0;
    double p95 = 0;
    const bool has_ap = parse(cut(rest, ','), ap) && ap >= 0 && ap <= 1;
    for (int skipped = 0; skipped < 3; ++skipped) cut(rest, ',');  // the other accuracies
    if (!has_ap || !parse(cut(rest, ','), median) || !parse(cut(rest, ','), p95) ||
        !(median > 0 && median < 1e6) || !(p95 >= median && p95 < 1e6)) {
      break;
    }
    return {ap, from_ms(median), from_ms(p95)};
  }
  throw bad("profile", file,
            "no figures of " + std::string(recording) + " on " + std::string(input));
}

class Replay : public Detector {
 public:
  Replay(Recording raw, Recording sampled, Duration time, std::function<void(Duration)> spend)
      : raw_(std::move(raw)), sampled_(std::move(sampled)), time_(time), spend_(std::move(spend)) {}

  // A frame that was not recorded shows nobody.
  std::vector<Box> detect(const Image& image) override {
    spend_(time_);
    const Recording& recording = image.bgr.cols > kSampledWidth ? raw_ : sampled_;
    if (image.frame >= recording.size()) return {};
    std::vector<Box> boxes = recording[image.frame];
    const float sx = static_cast<float>(image.source.width) / kSourceWidth;
    const float sy = static_cast<float>(image.source.height) / kSourceHeight;
    for (Box& box : boxes) {
      box = {
          .x = box.x * sx, .y = box.y * sy, .w = box.w * sx, .h = box.h * sy, .score = box.score};
    }
    return boxes;
  }

 private:
  Recording raw_;
  Recording sampled_;
  Duration time_;
  std::function<void(Duration)> spend_;
};

}  // namespace

std::vector<Level> replay_levels(const fs::path& data_dir, std::size_t max_levels,
                                 std::function<void(Duration)> spend) {
  if (!spend) spend = [](Duration time) { std::this_thread::sleep_for(time); };
  std::vector<Level> levels;
  for (const Recorded& recorded : kLevels) {
    if (levels.size() >= max_levels) break;
    const auto recording = [&](const char* input) {
      return read_recording(data_dir / "detections" /
                            (std::string(recorded.recording) + "__" + input + ".csv.gz"));
    };
    // Its times on raw: the size of the image makes no difference to a net of fixed input.
    const Profiled times = read_profile(data_dir / "profile.csv", recorded.recording, kRawInput);
    levels.push_back({.name = recorded.name,
                      .detector = std::make_shared<Replay>(
                          recording(kRawInput), recording(kSampledInput), times.median, spend),
                      .r_median = times.median,
                      .r_p95 = times.p95});
    add_measured(data_dir, levels.back());
  }
  return levels;
}

void add_measured(const fs::path& data_dir, Level& level) {
  const auto recorded =
      std::ranges::find_if(kLevels, [&](const Recorded& r) { return r.name == level.name; });
  if (recorded == kLevels.end()) return;
  level.quality = {recorded->ap_raw, recorded->ap_sampled};
  level.jpeg_quality.assign(recorded->ap_jpeg.begin(), recorded->ap_jpeg.end());
  level.draw_score = recorded->draw_score;
  level.recorded_median = from_ms(recorded->median_ms);
  const fs::path profile = data_dir / "profile.csv";
  std::error_code error;
  if (!fs::is_regular_file(profile, error)) return;
  level.quality = {read_profile(profile, recorded->recording, kRawInput).ap,
                   read_profile(profile, recorded->recording, kSampledInput).ap};
}

}  // namespace interneuron::perception
