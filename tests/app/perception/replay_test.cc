#include <zlib.h>

#include "app/perception/detector.h"
#include "support.h"

namespace interneuron::perception::replay_test {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const char* const kRecordings[] = {"L0_yolofastest_224", "L2_yoloxnano_256x192",
                                   "L4_yoloxnano_416x320"};

void write_gz(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  gzFile out = gzopen(file.c_str(), "wb");
  gzwrite(out, text.data(), static_cast<unsigned>(text.size()));
  gzclose(out);
}

// Frame 0 has a person at x = 100 (raw) or 200 (sampled), frame 2 two; x also tells the level.
void write_recordings(const TempDir& dir) {
  std::string profile =
      "level,input,bytes_rgb,AP,AP50,AR,R50,t1_p50_ms,t1_p95_ms,t1_p99_ms,t1_max_ms\n";
  for (int level = 0; level < 3; ++level) {
    const std::string name = kRecordings[level];
    const std::string x = std::to_string(level);
    write_gz(dir / ("detections/" + name + "__raw484x361.csv.gz"),
             "frame,x,y,w,h,score\n1,10" + x +
                 ".0,20.0,30.0,75.0,0.900\n3,1.0,2.0,3.0,4.0,0.5\n3,5,6,7,8,0.8\n");
    write_gz(dir / ("detections/" + name + "__s2_242x181.csv.gz"),
             "frame,x,y,w,h,score\n1,20" + x + ".0,20.0,30.0,75.0,0.900\n");
    profile += name + ",full768x576,1,0.1,0.4,0.2,0.6,99,99,99,99\n";
    profile += name + ",raw484x361,1,0.1,0.4,0.2,0.6," + std::to_string(10 * (level + 1)) + ".5," +
               std::to_string(12 * (level + 1)) + ",30,40\n";
    profile +=
        name + ",s2_242x181,1,0.0" + std::to_string(level + 1) + ",0.4,0.2,0.6,99,99,99,99\n";
  }
  write_text(dir / "profile.csv", profile);
}

Image image_of(std::uint32_t frame, Variant variant = Variant::kRaw) {
  return make_variant(scene(), frame, variant);
}

class Replay : public ::testing::Test {
 protected:
  Replay() { write_recordings(dir_); }
  Ladder ladder() {
    return make_ladder({.kind = LadderKind::kReplay,
                        .data_dir = dir_.path(),
                        .spend = [this](Duration time) { spent_ += time; }});
  }
  std::string complain() {
    return complaint([this] { ladder(); });
  }

  TempDir dir_;
  Duration spent_{};
};

TEST_F(Replay, PlaysTheFrameLevelAndInputAskedFor) {
  Ladder replay = ladder();
  ASSERT_EQ(replay.size(), 3U);
  EXPECT_EQ(replay.detect(0, image_of(0)), (std::vector<Box>{{100, 20, 30, 75, 0.9F}}));
  EXPECT_EQ(replay.detect(2, image_of(0)), (std::vector<Box>{{102, 20, 30, 75, 0.9F}}));
  EXPECT_EQ(replay.detect(1, image_of(0, Variant::kSampled)),
            (std::vector<Box>{{201, 20, 30, 75, 0.9F}}));
  EXPECT_TRUE(replay.detect(0, image_of(1)).empty());
  EXPECT_EQ(replay.detect(0, image_of(2)),
            (std::vector<Box>{{5, 6, 7, 8, 0.8F}, {1, 2, 3, 4, 0.5F}}));
  EXPECT_TRUE(replay.detect(0, image_of(4'000'000'000U)).empty());
}

TEST_F(Replay, SpendsTheRecordedTime) {
  Ladder replay = ladder();
  EXPECT_EQ(replay.level(1).r_median, 20'500us);
  EXPECT_EQ(replay.level(1).r_p95, 24ms);
  replay.detect(1, image_of(0));
  replay.detect(0, image_of(1));
  EXPECT_EQ(spent_, 31ms);
  EXPECT_EQ(replay.top_level(25ms), 1U);
  EXPECT_THAT(replay.description(), HasSubstr("replay"));
}

TEST_F(Replay, TheQualityOfRawAndSampledIsRecorded) {
  const Ladder replay = ladder();
  for (std::size_t level = 0; level < replay.size(); ++level) {
    EXPECT_EQ(replay.level(level).quality,
              (std::vector<double>{0.1, static_cast<double>(level + 1) / 100}));
  }
}

TEST_F(Replay, CalibrationKeepsTheRecordedTimes) {
  Ladder replay = ladder();
  const std::vector<Image> images = {image_of(0)};
  replay.calibrate(images, 5);
  EXPECT_EQ(spent_, 0ms);
  EXPECT_EQ(replay.level(0).r_median, 10'500us);
}

TEST_F(Replay, BoxesAreInPixelsOfTheSource) {
  Ladder replay = ladder();
  Image image = image_of(0);
  image.source = {384, 1152};
  EXPECT_EQ(replay.detect(0, image), (std::vector<Box>{{50, 40, 15, 150, 0.9F}}));
}

TEST_F(Replay, BadRecordingsAreNamed) {
  const std::string file = "detections/L0_yolofastest_224__raw484x361.csv.gz";
  const auto named = AllOf(HasSubstr(file), HasSubstr("--data"), Not(HasSubstr("\n")));
  write_gz(dir_ / file, "frame,x,y,w,h,score\n1,1,2,3,4,0.5\n1,1,2,three,4,0.5\n");
  EXPECT_THAT(complain(), AllOf(named, HasSubstr("line 3")));
  write_gz(dir_ / file, "frame,x,y,w,h,score\n99999999999,1,2,3,4,0.5\n");
  EXPECT_THAT(complain(), named);
  write_gz(dir_ / file, "frame,x,y,w,h,score\n0,1,2,3,4,0.5\n");
  EXPECT_THAT(complain(), named);
  write_gz(dir_ / file, "something else\n");
  EXPECT_THAT(complain(), named);
  std::filesystem::remove(dir_ / file);
  EXPECT_THAT(complain(), named);
}

TEST_F(Replay, ATruncatedRecordingIsNamed) {
  const std::string file = "detections/L0_yolofastest_224__raw484x361.csv.gz";
  std::string text = "frame,x,y,w,h,score\n";
  for (int i = 1; i < 500; ++i) text += std::to_string(i) + ",1,2,3,4,0.5\n";
  write_gz(dir_ / file, text);
  std::filesystem::resize_file(dir_ / file, std::filesystem::file_size(dir_ / file) - 20);
  EXPECT_THAT(complain(), HasSubstr("damaged"));
}

TEST_F(Replay, ABadProfileIsNamed) {
  const std::string header =
      "level,input,bytes_rgb,AP,AP50,AR,R50,t1_p50_ms,t1_p95_ms,t1_p99_ms,t1_max_ms\n";
  for (const std::string& text :
       {std::string(""), header, header + "L0_yolofastest_224,raw484x361,1,1,1,1,1,fast,1,1,1\n",
        header + "L0_yolofastest_224,raw484x361,1,1,1,1,1,-5,1,1,1\n",
        header + "L0_yolofastest_224,raw484x361\n"}) {
    write_text(dir_ / "profile.csv", text);
    EXPECT_THAT(complain(), AllOf(HasSubstr("profile.csv"), HasSubstr("--data")));
  }
  std::filesystem::remove(dir_ / "profile.csv");
  EXPECT_THAT(complain(), HasSubstr("profile.csv"));
}

}  // namespace
}  // namespace interneuron::perception::replay_test
