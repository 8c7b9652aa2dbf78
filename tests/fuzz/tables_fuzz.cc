// Tables of figures that users hand over as files: rounds.csv of a run, the ground truth of MOT15,
// a sweep of KITTI or nuScenes, and the recordings and the profile of the replayed detectors,
// packed or not. The first byte says which; the rest is the file. The only exceptions are Failure
// and InputError, which name the file.
#include <zlib.h>

#include <string>

#include "app/perception/accuracy.h"
#include "app/perception/levels.h"
#include "app/perception/point_cloud.h"
#include "app/process/failure.h"
#include "app/records/run_files.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"
#include "tests/fuzz/scratch_folder.h"

namespace {

using namespace interneuron;
using fuzz::require;

constexpr std::string_view kRecording = "frame,x,y,w,h,score\n1,10.5,20,30,75,0.9\n";
constexpr std::string_view kProfile =
    "level,input,bytes_rgb,AP,AP50,AR,R50,t1_p50_ms,t1_p95_ms,t1_p99_ms,t1_max_ms\n"
    "L0_yolofastest_224,raw484x361,1,0.1,0.4,0.2,0.6,10.5,12,30,40\n"
    "L0_yolofastest_224,s2_242x181,1,0.05,0.4,0.2,0.6,10,12,30,40\n";

const fuzz::ScratchFolder& folder() {
  static const fuzz::ScratchFolder out;
  return out;
}

void try_rounds(std::string_view text) {
  const auto file = folder().write("rounds.csv", text);
  try {
    const auto rows = records::read_csv(file);
    records::summarise(rows, {});
    records::write_csv(file, rows);
    require(records::read_csv(file).size() == rows.size(),
            "rows are lost by being written and read");
  } catch (const process::Failure& failure) {
    require(failure.code() == process::kFailed, "a bad table has another exit code");
  }
}

void try_truth(std::string_view text) {
  try {
    const auto truth = perception::read_mot_truth(folder().write("gt.txt", text));
    const perception::Shown shown{.frame = 0, .boxes = {{10, 20, 30, 40, 0.9F}}};
    const auto accuracy = perception::evaluate(truth, std::span(&shown, 1));
    require(accuracy.ap >= 0 && accuracy.ap <= 1 && accuracy.ar >= 0 && accuracy.ar <= 1,
            "an accuracy is out of bounds");
  } catch (const perception::InputError&) {
    // The line that is wrong is named.
  }
}

void try_cloud(std::string_view bytes, const char* name) {
  try {
    const auto points = perception::read_cloud(folder().write(name, bytes));
    require(points.cols() > 0 && points.allFinite(), "a sweep has no points, or bad ones");
    perception::voxel_grid(points, 0.2);
  } catch (const perception::InputError&) {
    // What is wrong is named.
  }
}

std::string packed(std::string_view text) {
  std::string out(compressBound(text.size()) + 32, '\0');
  z_stream stream{};
  // 16 above the largest window: with a header of gzip.
  constexpr int kGzip = 16 + MAX_WBITS;
  deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

void try_replay(std::string_view recording, std::string_view profile) {
  const std::string base = "detections/L0_yolofastest_224__";
  folder().write(base + "raw484x361.csv.gz", recording);
  folder().write(base + "s2_242x181.csv.gz", packed(kRecording));
  folder().write("profile.csv", profile);
  try {
    const auto levels = perception::replay_levels(folder().path(), 1, [](Duration) {});
    require(levels.size() == 1 && levels[0].r_median > Duration::zero() &&
                levels[0].r_p95 >= levels[0].r_median,
            "a level has no times");
  } catch (const perception::InputError&) {
    // What is wrong is named.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input({data, size});
  // Letters, so that seeds are files that people can read.
  switch (input.take<char>()) {
    case 'c':
      try_rounds(input.text());
      break;
    case 'm':
      try_truth(input.text());
      break;
    case 'k':
      try_cloud(input.text(), "sweep.bin");
      break;
    case 'n':
      try_cloud(input.text(), "sweep.pcd.bin");
      break;
    case 'r':
      try_replay(packed(input.text()), kProfile);
      break;
    case 'z':
      try_replay(input.text(), kProfile);
      break;
    case 'p':
      try_replay(packed(kRecording), input.text());
      break;
    default:
      break;
  }
  return 0;
}
