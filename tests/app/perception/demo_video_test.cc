// Accuracies on the demo video, with its ground truth. Skipped where the data is not there.
#include "app/perception/accuracy.h"
#include "app/perception/detector.h"
#include "app/perception/frame_source.h"
#include "support.h"

namespace interneuron::perception::demo_video_test {
namespace {

constexpr int kVideoFrames = 795;
const char* const kVideo = "pets/vtest.avi";
const char* const kTruth = "pets/gt.txt";
constexpr std::array kShownVariants{Variant::kRaw, Variant::kSampled};
constexpr auto kRaw = static_cast<std::size_t>(Variant::kRaw);
constexpr auto kSampled = static_cast<std::size_t>(Variant::kSampled);

// Shows every `step`-th frame of the video to one level.
Accuracy accuracy_of(Ladder& ladder, std::size_t level, Variant variant, int step = 1) {
  FrameSource source((*data_dir() / kVideo).string());
  std::vector<Shown> rounds;
  while (const auto frame = source.next()) {
    if (frame->index % step != 0) continue;
    const Image image = make_variant(frame->bgr, static_cast<std::uint32_t>(frame->index), variant);
    rounds.push_back({frame->index, ladder.detect(level, image)});
  }
  return evaluate(read_mot_truth(*data_dir() / kTruth), rounds);
}

Accuracy recorded_accuracy(std::size_t level, Variant variant) {
  Ladder ladder =
      make_ladder({.kind = LadderKind::kReplay, .data_dir = *data_dir(), .spend = [](Duration) {}});
  Image image = make_variant(cv::Mat(576, 768, CV_8UC3, cv::Scalar::all(0)), 0, variant);
  std::vector<Shown> rounds;
  for (int frame = 0; frame < kVideoFrames; ++frame) {
    image.frame = static_cast<std::uint32_t>(frame);
    rounds.push_back({frame, ladder.detect(level, image)});
  }
  return evaluate(read_mot_truth(*data_dir() / kTruth), rounds);
}

// The figures of an independent program in Python on the same boxes (profile.csv).
TEST(DemoVideo, RecordedBoxesHaveTheKnownAccuracy) {
  if (skips_without({"detections", kTruth})) return;
  const Accuracy best = recorded_accuracy(2, Variant::kRaw);
  EXPECT_EQ(best.truths, 4476U);
  EXPECT_NEAR(best.ap, 0.396, 0.005);
  EXPECT_NEAR(best.ap50, 0.899, 0.005);
  EXPECT_NEAR(best.ar, 0.504, 0.005);
  EXPECT_NEAR(best.recall50, 0.941, 0.005);
  const Accuracy least = recorded_accuracy(0, Variant::kSampled);
  EXPECT_NEAR(least.ap, 0.128, 0.005);
  EXPECT_NEAR(least.ap50, 0.471, 0.005);
}

TEST(DemoVideo, RecordedLevelsAreOrderedByQuality) {
  if (skips_without({"detections", kTruth})) return;
  for (const Variant variant : {Variant::kRaw, Variant::kSampled}) {
    EXPECT_LT(recorded_accuracy(0, variant).ap, recorded_accuracy(1, variant).ap);
    EXPECT_LT(recorded_accuracy(1, variant).ap, recorded_accuracy(2, variant).ap);
  }
}

// What survives the quantisation of the result message.
TEST(DemoVideo, TheResultMessageCostsNoAccuracy) {
  if (skips_without({"detections", kTruth})) return;
  Ladder ladder =
      make_ladder({.kind = LadderKind::kReplay, .data_dir = *data_dir(), .spend = [](Duration) {}});
  Image image = make_variant(cv::Mat(576, 768, CV_8UC3, cv::Scalar::all(0)), 0, Variant::kRaw);
  std::vector<Shown> rounds;
  for (int frame = 0; frame < kVideoFrames; ++frame) {
    image.frame = static_cast<std::uint32_t>(frame);
    const Bytes bytes = encode_result({.frame = image.frame, .boxes = ladder.detect(2, image)});
    rounds.push_back({frame, decode_result(bytes)->boxes});
  }
  EXPECT_NEAR(evaluate(read_mot_truth(*data_dir() / kTruth), rounds).ap, 0.396, 0.005);
}

// What the three lowest levels of the motion ladder find in the whole video in each variant. One
// pass serves several tests, as the levels share the background model too.
struct MotionPass {
  std::vector<Ladder> ladders;                          // [variant]
  std::vector<std::vector<std::vector<Shown>>> rounds;  // [variant][level]
};

const MotionPass& motion_pass() {
  static const MotionPass pass = [] {
    MotionPass p;
    p.rounds.resize(kShownVariants.size());
    for (auto& of_variant : p.rounds) {
      p.ladders.push_back(make_ladder({.kind = LadderKind::kMotion, .max_levels = 3}));
      of_variant.resize(p.ladders.back().size());
    }
    FrameSource source((*data_dir() / kVideo).string());
    while (const auto frame = source.next()) {
      for (std::size_t v = 0; v < kShownVariants.size(); ++v) {
        const Image image =
            make_variant(frame->bgr, static_cast<std::uint32_t>(frame->index), kShownVariants[v]);
        for (std::size_t level = 0; level < p.rounds[v].size(); ++level) {
          p.rounds[v][level].push_back({frame->index, p.ladders[v].detect(level, image)});
        }
      }
    }
    return p;
  }();
  return pass;
}

TEST(DemoVideo, MotionWithHogReachesItsAccuracy) {
  if (skips_without({kVideo, kTruth})) return;
  ASSERT_EQ(motion_pass().ladders[kRaw].level(2).name, "motion+HOG 960x720");
  const Accuracy a = evaluate(read_mot_truth(*data_dir() / kTruth), motion_pass().rounds[kRaw][2]);
  EXPECT_GE(a.ap50, 0.83);  // measured .86
  EXPECT_GE(a.ap, 0.36);    // .38
}

TEST(DemoVideo, MotionAloneIsTheLowestLevel) {
  if (skips_without({kVideo, kTruth})) return;
  const Accuracy a =
      evaluate(read_mot_truth(*data_dir() / kTruth), motion_pass().rounds[kSampled][0]);
  EXPECT_GE(a.ap50, 0.48);  // measured .52
  EXPECT_LE(a.ap50, 0.7);
}

TEST(DemoVideo, WholeFrameFindsPersonsWithoutABackground) {
  if (skips_without({kVideo})) return;
  Ladder ladder = make_ladder({.kind = LadderKind::kMotion});
  FrameSource source((*data_dir() / kVideo).string());
  const Image image = make_variant(source.next()->bgr, 0, Variant::kRaw);
  EXPECT_GE(ladder.detect(ladder.size() - 1, image).size(), 3U);
}

// What the levels tell of themselves.
TEST(DemoVideo, MotionLevelsAreWorthWhatTheyTell) {
  if (skips_without({kVideo, kTruth})) return;
  const GroundTruth truth = read_mot_truth(*data_dir() / kTruth);
  for (const std::size_t variant : {kRaw, kSampled}) {
    const auto& rounds = motion_pass().rounds[variant];
    for (std::size_t i = 0; i < rounds.size(); ++i) {
      const Level& level = motion_pass().ladders[variant].level(i);
      EXPECT_NEAR(evaluate(truth, rounds[i]).ap, level.quality[variant], 0.01) << level.name;
      const ShownShare drawn = share_shown(truth, rounds[i], level.draw_score);
      EXPECT_GE(drawn.precision, 0.7) << level.name;
      EXPECT_GE(drawn.recall, 0.55) << level.name;
    }
  }
}

// By recorded times and the AP on the demo video: in 20 ms no good net fits, but motion does.
TEST(DemoVideo, AutoTakesTheLadderThatIsWorthMostInTheTime) {
  if (skips_without({"models"})) return;
  const auto in = [](std::chrono::milliseconds budget) {
    return make_ladder({.kind = LadderKind::kAuto, .data_dir = *data_dir(), .budget = budget})
        .description();
  };
  EXPECT_THAT(in(std::chrono::milliseconds(15)),
              ::testing::AllOf(::testing::HasSubstr("ladder motion"),
                               ::testing::HasSubstr("within 15 ms")));
}

TEST(DemoVideo, NetsReachTheirAccuracyOnSomeFrames) {
  if (skips_without({"models", kVideo, kTruth})) return;
  Ladder ladder = make_ladder({.kind = LadderKind::kDnn, .data_dir = *data_dir()});
  ASSERT_EQ(ladder.size(), 3U);
  EXPECT_GE(accuracy_of(ladder, 0, Variant::kRaw, 25).ap50, 0.40);      // all frames: .48
  EXPECT_GE(accuracy_of(ladder, 1, Variant::kRaw, 25).ap50, 0.78);      // .85
  EXPECT_GE(accuracy_of(ladder, 1, Variant::kSampled, 25).ap50, 0.76);  // .83
  EXPECT_GE(accuracy_of(ladder, 2, Variant::kRaw, 25).ap50, 0.82);      // .90
}

TEST(DemoVideo, TruncatedModelsAreNamed) {
  if (skips_without({"models"})) return;
  for (const char* model : {"yolo-fastest-1.1.cfg", "yolox_nano.onnx"}) {
    const TempDir copy;
    // File by file: copying the folder would copy its mode too, and the data may be read-only.
    std::filesystem::create_directory(copy / "models");
    for (const auto& entry : std::filesystem::directory_iterator(*data_dir() / "models")) {
      std::ofstream(copy / ("models/" + entry.path().filename().string()), std::ios::binary)
          << std::ifstream(entry.path(), std::ios::binary).rdbuf();
    }
    const auto file = copy / (std::string("models/") + model);
    std::filesystem::permissions(file, std::filesystem::perms::owner_write,
                                 std::filesystem::perm_options::add);
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
    EXPECT_THAT(
        complaint([&] { make_ladder({.kind = LadderKind::kDnn, .data_dir = copy.path()}); }),
        ::testing::AllOf(::testing::HasSubstr("models/yolo"),
                         ::testing::HasSubstr("scripts/fetch_data.sh"),
                         ::testing::Not(::testing::HasSubstr("\n"))))
        << model;
  }
}

TEST(DemoVideo, AutoTakesTheNetsWhenTheyAreThere) {
  if (skips_without({"models"})) return;
  const Ladder ladder =
      make_ladder({.kind = LadderKind::kAuto, .data_dir = *data_dir(), .max_levels = 1});
  EXPECT_EQ(ladder.description(), "ladder dnn (OpenCV): L0 yolo-fastest-1.1 224x224");
}

}  // namespace
}  // namespace interneuron::perception::demo_video_test
