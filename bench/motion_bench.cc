// How good and how fast each level of a ladder is on a video with ground truth: the program whose
// table the qualities and the drawing thresholds of the detectors' levels come from.
//
//   motion_bench --data DIR [--ladder motion|dnn|replay] [--level N] [--frames N] [--every N]
//                [--images paper|jpeg] [--jpeg DIVISOR:QUALITY]... [--brief]
//
// DIR holds pets/vtest.avi and pets/gt.txt (scripts/fetch_data.sh --ground-truth). Each level sees
// each frame once, in order, as it does in operation; times are of the processor, of one thread.
// With --jpeg, images of other sizes and qualities than those of the ladders are measured, which is
// how the rungs of the JPEG ladder were chosen.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "app/perception/accuracy.h"
#include "app/perception/detector.h"
#include "app/perception/frame_source.h"
#include "bench/cpu_time.h"
#include "core/base/statistics.h"

namespace interneuron::bench {
namespace {

using namespace perception;

// The distance between two thresholds of the table.
constexpr double kScoreStep = 0.05;

// How an image reaches the detector: as a variant of the codec, or as a JPEG of another form.
struct Form {
  std::string name;
  std::optional<Variant> variant{};
  JpegForm jpeg{};
};

Bytes encoded(const Form& form, const Frame& frame) {
  const auto number = static_cast<std::uint32_t>(frame.index);
  return form.variant ? encode_image(make_variant(frame.bgr, number, *form.variant))
                      : encode_jpeg(frame.bgr, number, form.jpeg);
}

// A JPEG is given up when the machine is busy (JpegLimits::time), which is not its fault.
Image decoded(const Bytes& bytes) {
  while (true) {
    if (const auto image = decode_image(bytes)) return *image;
  }
}

struct Run {
  std::vector<Shown> shown;
  std::vector<double> times_ms;
  std::vector<double> encode_ms;
  std::size_t bytes = 0;
};

struct Frames {
  std::string video;
  int most = 0;
  // Only every so-many-th one.
  int every = 1;
};

Run run_level(Ladder& ladder, std::size_t level, const Form& form, const Frames& frames) {
  FrameSource source(frames.video);
  ladder.level(level).detector->reset();
  Run run;
  while (const auto frame = source.next()) {
    if (frame->index >= frames.most) break;
    if (frame->index % frames.every != 0) continue;
    const double begin = thread_us();
    const Bytes bytes = encoded(form, *frame);
    run.encode_ms.push_back((thread_us() - begin) / 1e3);
    run.bytes += bytes.size();
    const Image image = decoded(bytes);
    const double start = thread_us();
    run.shown.push_back({frame->index, ladder.detect(level, image)});
    run.times_ms.push_back((thread_us() - start) / 1e3);
  }
  return run;
}

void print(const Level& level, const Form& form, const GroundTruth& truth, const Run& run,
           bool brief) {
  const Accuracy a = evaluate(truth, run.shown);
  std::printf(
      "%-26s %-10s AP %.4f AP50 %.3f AR %.3f  median %.1f ms p95 %.1f ms  %.1f kB, encoded in "
      "%.2f ms, p95 %.2f ms\n",
      level.name.c_str(), form.name.c_str(), a.ap, a.ap50, a.ar, percentile(run.times_ms, 0.5),
      percentile(run.times_ms, 0.95),
      static_cast<double>(run.bytes) / 1000 / static_cast<double>(run.shown.size()),
      percentile(run.encode_ms, 0.5), percentile(run.encode_ms, 0.95));
  for (double score = 0; !brief && score < 0.95; score += kScoreStep) {
    const ShownShare s = share_shown(truth, run.shown, static_cast<float>(score));
    if (s.boxes == 0) break;
    std::printf("    score >= %.2f: precision %.3f recall %.3f, %.1f boxes a frame\n", score,
                s.precision, s.recall,
                static_cast<double>(s.boxes) / static_cast<double>(run.shown.size()));
  }
  std::fflush(stdout);
}

struct Options {
  std::string data;
  std::string ladder = "motion";
  // One level; negative: all of them.
  int level = -1;
  int frames = 1'000'000;
  int every = 1;
  std::string images = "paper";
  std::vector<std::string> jpeg;
  bool brief = false;
};

// "DIVISOR:QUALITY".
Form jpeg_form(const std::string& text) {
  Form form{.name = text};
  const int read = std::sscanf(text.c_str(), "%d:%d", &form.jpeg.divisor, &form.jpeg.quality);
  if (read != 2 || form.jpeg.divisor < 1) {
    throw InputError("--jpeg '" + text + "': give DIVISOR:QUALITY, as in 2:50");
  }
  return form;
}

std::vector<Form> forms_of(const Options& o) {
  std::vector<Form> forms;
  for (const std::string& text : o.jpeg) forms.push_back(jpeg_form(text));
  if (!forms.empty()) return forms;
  for (const Variant variant : variants_of(*parse_images(o.images))) {
    forms.push_back({.name = std::string(to_string(variant)), .variant = variant});
  }
  return forms;
}

int measure(const Options& o) {
  const std::filesystem::path data = o.data;
  Ladder ladder = make_ladder({.kind = *parse_ladder_kind(o.ladder),
                               .data_dir = data,
                               .max_levels = 0,
                               .spend = [](Duration) {}});
  const GroundTruth truth = read_mot_truth(data / "pets/gt.txt");
  const Frames frames{(data / "pets/vtest.avi").string(), o.frames, o.every};
  for (std::size_t level = 0; level < ladder.size(); ++level) {
    if (o.level >= 0 && level != static_cast<std::size_t>(o.level)) continue;
    for (const Form& form : forms_of(o)) {
      print(ladder.level(level), form, truth, run_level(ladder, level, form, frames), o.brief);
    }
  }
  return 0;
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  CLI::App app("Accuracy and run time of each level of a ladder");
  interneuron::bench::Options o;
  app.add_option("--data", o.data, "Folder with pets/vtest.avi and pets/gt.txt")->required();
  app.add_option("--ladder", o.ladder, "Detectors")
      ->check(CLI::IsMember({"dnn", "motion", "replay"}));
  app.add_option("--level", o.level, "Only this level");
  app.add_option("--frames", o.frames, "Only so many frames");
  app.add_option("--every", o.every, "Only every so-many-th frame")->check(CLI::Range(1, 1000));
  app.add_option("--images", o.images, "Ladder of images")->check(CLI::IsMember({"paper", "jpeg"}));
  app.add_option("--jpeg", o.jpeg, "JPEG of 1/DIVISOR of each side, DIVISOR:QUALITY");
  app.add_flag("--brief", o.brief, "Without the table of drawing thresholds");
  CLI11_PARSE(app, argc, argv);
  try {
    return interneuron::bench::measure(o);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "motion_bench: %s\n", error.what());
    return 1;
  }
}
