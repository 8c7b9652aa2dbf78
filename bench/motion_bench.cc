// How good and how fast each level of a ladder is on a video with ground truth: the program whose
// table the qualities and the drawing thresholds of the detectors' levels come from.
//
//   motion_bench --data DIR [--ladder motion|dnn|replay] [--level N] [--frames N]
//
// DIR holds pets/vtest.avi and pets/gt.txt (scripts/fetch_data.sh --ground-truth). Each level sees
// each frame once, in order, as it does in operation; times are of the processor, of one thread.
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "perception/accuracy.h"
#include "perception/detector.h"
#include "perception/frame_source.h"

namespace interneuron::perception {
namespace {

// The distance between two thresholds of the table.
constexpr double kScoreStep = 0.05;

double cpu_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) / 1e6;
}

struct Run {
  std::vector<Shown> shown;
  std::vector<double> times_ms;
};

Run run_level(Ladder& ladder, std::size_t level, Variant variant, const std::string& video,
              int frames) {
  FrameSource source(video);
  ladder.level(level).detector->reset();
  Run run;
  while (const auto frame = source.next()) {
    if (frame->index >= frames) break;
    const Image image = make_variant(frame->bgr, static_cast<std::uint32_t>(frame->index), variant);
    const double start = cpu_ms();
    run.shown.push_back({frame->index, ladder.detect(level, image)});
    run.times_ms.push_back(cpu_ms() - start);
  }
  std::sort(run.times_ms.begin(), run.times_ms.end());
  return run;
}

double at_share(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

void print(const Level& level, Variant variant, const GroundTruth& truth, const Run& run) {
  const Accuracy a = evaluate(truth, run.shown);
  std::printf("%-40s %-7s AP %.3f AP50 %.3f AR %.3f  median %.1f ms p95 %.1f ms\n",
              level.name.c_str(), variant == Variant::kRaw ? "raw" : "sampled", a.ap, a.ap50, a.ar,
              at_share(run.times_ms, 0.5), at_share(run.times_ms, 0.95));
  for (double score = 0; score < 0.95; score += kScoreStep) {
    const ShownShare s = share_shown(truth, run.shown, static_cast<float>(score));
    if (s.boxes == 0) break;
    std::printf("    score >= %.2f: precision %.3f recall %.3f, %.1f boxes a frame\n", score,
                s.precision, s.recall,
                static_cast<double>(s.boxes) / static_cast<double>(run.shown.size()));
  }
  std::fflush(stdout);
}

// `only`: one level; negative: all of them.
int measure(const std::filesystem::path& data, const std::string& kind, int only, int frames) {
  Ladder ladder = make_ladder(
      {.kind = *parse_ladder_kind(kind), .data_dir = data, .max_levels = 0, .spend = [](Duration) {
       }});
  const GroundTruth truth = read_mot_truth(data / "pets/gt.txt");
  for (std::size_t level = 0; level < ladder.size(); ++level) {
    if (only >= 0 && level != static_cast<std::size_t>(only)) continue;
    for (const Variant variant : {Variant::kRaw, Variant::kSampled}) {
      const Run run = run_level(ladder, level, variant, (data / "pets/vtest.avi").string(), frames);
      print(ladder.level(level), variant, truth, run);
    }
  }
  return 0;
}

}  // namespace
}  // namespace interneuron::perception

int main(int argc, char** argv) {
  CLI::App app("Accuracy and run time of each level of a ladder");
  std::string data;
  std::string kind = "motion";
  int level = -1;
  int frames = 1'000'000;
  app.add_option("--data", data, "Folder with pets/vtest.avi and pets/gt.txt")->required();
  app.add_option("--ladder", kind, "Detectors")->check(CLI::IsMember({"dnn", "motion", "replay"}));
  app.add_option("--level", level, "Only this level");
  app.add_option("--frames", frames, "Only so many frames");
  CLI11_PARSE(app, argc, argv);
  try {
    return interneuron::perception::measure(data, kind, level, frames);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "motion_bench: %s\n", error.what());
    return 1;
  }
}
