#include <set>
#include <thread>

#include "app/perception/detector.h"
#include "support.h"

namespace interneuron::perception::ladder_test {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// Takes the time it is told, and notes what it is asked.
class Sleeper : public Detector {
 public:
  explicit Sleeper(Duration time) : time_(time) {}
  std::vector<Box> detect(const Image& image) override {
    std::this_thread::sleep_for(time_);
    frames.push_back(image.frame);
    return {{0, 0, 1, 1, 1}};
  }
  void reset() override { ++resets; }

  std::vector<std::uint32_t> frames;
  int resets = 0;

 private:
  Duration time_;
};

Level timed(Duration median, Duration p95) {
  return {.name = "level",
          .detector = std::make_shared<Sleeper>(0ms),
          .r_median = median,
          .r_p95 = p95};
}

TEST(Ladder, TopLevelIsTheBestThatFits) {
  const Ladder ladder("test", {timed(8ms, 10ms), timed(19ms, 24ms), timed(44ms, 46ms)}, true);
  EXPECT_EQ(ladder.top_level(1s), 2U);
  EXPECT_EQ(ladder.top_level(46ms), 2U);
  EXPECT_EQ(ladder.top_level(45ms), 1U);
  EXPECT_EQ(ladder.top_level(24ms), 1U);
  EXPECT_EQ(ladder.top_level(23ms), 0U);
  EXPECT_EQ(ladder.top_level(0ms), 0U);  // the lowest runs in any case
  EXPECT_EQ(ladder.top_level(-5ms), 0U);
}

TEST(Ladder, TopLevelSkipsASlowMiddle) {
  const Ladder ladder("test", {timed(8ms, 10ms), timed(50ms, 60ms), timed(40ms, 45ms)}, true);
  EXPECT_EQ(ladder.top_level(45ms), 2U);
}

TEST(Ladder, TopLevelIsZeroWhileTimesAreUnknown) {
  const Ladder ladder("test", {timed(0ms, 0ms), timed(0ms, 0ms)});
  EXPECT_EQ(ladder.top_level(1s), 0U);
}

TEST(Ladder, CalibrateMeasuresEachLevel) {
  const auto fast = std::make_shared<Sleeper>(1ms);
  const auto slow = std::make_shared<Sleeper>(4ms);
  Ladder ladder("test", {{.name = "fast", .detector = fast}, {.name = "slow", .detector = slow}});
  std::vector<std::string> seen;
  const std::vector<Image> images = {make_variant(scene(), 700, Variant::kRaw)};
  ladder.calibrate(images, 20, [&](const Level& level, std::size_t done, std::size_t total) {
    seen.push_back(level.name + std::to_string(done) + "/" + std::to_string(total));
    EXPECT_GT(level.r_median, Duration::zero());
  });
  EXPECT_THAT(seen, ::testing::ElementsAre("fast1/2", "slow2/2"));
  EXPECT_GE(ladder.level(0).r_median, 1ms);
  EXPECT_GE(ladder.level(1).r_median, 4ms);
  EXPECT_GE(ladder.level(1).r_p95, ladder.level(1).r_median);
  EXPECT_EQ(fast->resets, 2);  // before and after: nothing learnt is left
  // A background learns from each, though there is one image only.
  EXPECT_EQ(std::set<std::uint32_t>(fast->frames.begin(), fast->frames.end()).size(),
            fast->frames.size());
}

TEST(Ladder, CalibrateLeavesKnownTimesAlone) {
  Ladder ladder("test", {timed(8ms, 10ms)}, true);
  int calls = 0;
  const std::vector<Image> images = {make_variant(scene(), 0, Variant::kRaw)};
  ladder.calibrate(images, 5, [&](const Level&, std::size_t, std::size_t) { ++calls; });
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(ladder.level(0).r_p95, 10ms);
}

TEST(Ladder, CalibrateNeedsImages) {
  Ladder ladder("test", {timed(0ms, 0ms)});
  EXPECT_THROW(ladder.calibrate({}, 5), InputError);
  const std::vector<Image> images = {make_variant(scene(), 0, Variant::kRaw)};
  EXPECT_THROW(ladder.calibrate(images, 0), InputError);
}

TEST(Ladder, DescriptionNamesLevelsAndTimes) {
  const Ladder ladder("test", {timed(8ms, 10ms), timed(19ms, 24ms)}, true);
  EXPECT_EQ(ladder.description(),
            "ladder test: L0 level 8.0/10.0 ms, L1 level 19.0/24.0 ms (median/p95, 1 thread)");
}

TEST(Ladder, ExpectedQualityIsOfTheBestLevelThatFits) {
  const auto level = [](double quality, Duration median) {
    return Level{.name = "level", .quality = {quality, 0.0}, .recorded_median = median};
  };
  const std::vector<Level> nets = {level(0.14, 8ms), level(0.40, 50ms)};
  const std::vector<Level> motion = {level(0.20, 1ms), level(0.38, 7ms)};
  EXPECT_EQ(expected_quality(nets, 65ms), 0.40);
  EXPECT_EQ(expected_quality(nets, 0ms), 0.40);  // no bound
  EXPECT_EQ(expected_quality(nets, 20ms), 0.14);
  EXPECT_EQ(expected_quality(motion, 20ms), 0.38);
  EXPECT_EQ(expected_quality(nets, 5ms), 0);
}

TEST(MakeLadder, EveryMotionLevelTellsWhatItIsWorth) {
  const Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  for (std::size_t i = 0; i < ladder.size(); ++i) {
    for (const Images images : {Images::kPaper, Images::kJpeg}) {
      EXPECT_EQ(ladder.level(i).quality_on(images).size(), variants_of(images).size()) << i;
    }
    ASSERT_EQ(ladder.level(i).quality.size(), 2U) << i;
    EXPECT_GT(ladder.level(i).recorded_median, Duration::zero()) << i;
    if (i > 0) {
      EXPECT_GT(ladder.level(i).quality[0], ladder.level(i - 1).quality[0]) << i;
    }
  }
}

TEST(LadderKind, Parses) {
  EXPECT_EQ(parse_ladder_kind("auto"), LadderKind::kAuto);
  EXPECT_EQ(parse_ladder_kind("dnn"), LadderKind::kDnn);
  EXPECT_EQ(parse_ladder_kind("motion"), LadderKind::kMotion);
  EXPECT_EQ(parse_ladder_kind("replay"), LadderKind::kReplay);
  EXPECT_EQ(parse_ladder_kind("yolo"), std::nullopt);
}

TEST(MakeLadder, MissingModelIsNamedWithTheRemedy) {
  const TempDir dir;
  EXPECT_THAT(complaint([&] { make_ladder({.kind = LadderKind::kDnn, .data_dir = dir.path()}); }),
              AllOf(HasSubstr((dir / "models/yolo-fastest-1.1.cfg").string()),
                    HasSubstr("scripts/fetch_data.sh"), Not(HasSubstr("\n"))));
}

TEST(MakeLadder, DamagedModelIsNamedWithTheRemedy) {
  const TempDir dir;
  for (const char* file : {"yolo-fastest-1.1.cfg", "yolo-fastest-1.1.weights", "yolox_nano.onnx"}) {
    write_text(dir / (std::string("models/") + file), "damaged");
  }
  EXPECT_THAT(complaint([&] { make_ladder({.kind = LadderKind::kDnn, .data_dir = dir.path()}); }),
              AllOf(HasSubstr("yolo-fastest-1.1"), HasSubstr("scripts/fetch_data.sh"),
                    Not(HasSubstr("\n"))));
}

TEST(MakeLadder, AutoFallsBackToMotionAndSaysWhy) {
  const TempDir dir;
  const Ladder ladder = make_ladder({.kind = LadderKind::kAuto, .data_dir = dir.path()});
  EXPECT_THAT(ladder.description(), AllOf(HasSubstr("ladder motion"), HasSubstr("yolox_nano.onnx"),
                                          HasSubstr("scripts/fetch_data.sh"),
                                          HasSubstr("fixed cameras only"), Not(HasSubstr("\n"))));
}

TEST(MakeLadder, ABackupIsTheLowestLevelAlone) {
  const Ladder ladder = make_ladder({.kind = LadderKind::kMotion, .max_levels = 1});
  EXPECT_EQ(ladder.size(), 1U);
  EXPECT_EQ(ladder.level(0).name, "motion");
}

}  // namespace
}  // namespace interneuron::perception::ladder_test
