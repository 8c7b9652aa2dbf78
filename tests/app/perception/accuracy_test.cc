#include "app/perception/accuracy.h"

#include "support.h"

namespace interneuron::perception::accuracy_test {
namespace {

using ::testing::HasSubstr;

const Box kPerson{10, 10, 10, 20, 0};
const Box kOther{100, 10, 10, 20, 0};

Box scored(Box box, float score) {
  box.score = score;
  return box;
}

TEST(Accuracy, PerfectBoxesGiveOne) {
  const Accuracy a = evaluate({{0, {{kPerson}}}}, std::vector<Shown>{{0, {scored(kPerson, 0.5F)}}});
  EXPECT_DOUBLE_EQ(a.ap50, 1);
  EXPECT_NEAR(a.ap, 1, 1e-12);
  EXPECT_NEAR(a.ar, 1, 1e-12);
  EXPECT_EQ(a.truths, 1U);
}

TEST(Accuracy, ARoundWithoutResultMissesItsPersons) {
  const GroundTruth truth = {{0, {{kPerson}}}, {1, {{kPerson}}}};
  const Accuracy a = evaluate(truth, std::vector<Shown>{{0, {scored(kPerson, 0.5F)}}, {1, {}}});
  EXPECT_EQ(a.truths, 2U);
  EXPECT_NEAR(a.ap50, 51.0 / 101, 1e-12);  // recalls 0 … .50 are reached
  EXPECT_NEAR(a.ap, 51.0 / 101, 1e-12);
  EXPECT_NEAR(a.ar, 0.5, 1e-12);
}

TEST(Accuracy, NothingShownOrNothingToFindIsZero) {
  EXPECT_EQ(evaluate({{0, {{kPerson}}}}, std::vector<Shown>{{0, {}}}).ap, 0);
  const Accuracy a = evaluate({}, std::vector<Shown>{{0, {scored(kPerson, 1)}}});
  EXPECT_EQ(a.truths, 0U);
  EXPECT_EQ(a.ap, 0);
  EXPECT_EQ(a.ar, 0);
  EXPECT_EQ(evaluate({}, {}).truths, 0U);
}

TEST(Accuracy, LooseBoxCountsUpToItsIou) {
  // 15 of 20 pixels high: IoU .75, so .50 … .75, 6 of 10 thresholds.
  const Accuracy a =
      evaluate({{0, {{kPerson}}}}, std::vector<Shown>{{0, {{10, 10, 10, 15, 0.9F}}}});
  EXPECT_DOUBLE_EQ(a.ap50, 1);
  EXPECT_NEAR(a.ap, 0.6, 1e-12);
  EXPECT_NEAR(a.ar, 0.6, 1e-12);
}

TEST(Accuracy, FalseAlarmsCostOnlyWhenScoredHigher) {
  const GroundTruth truth = {{0, {{kPerson}}}};
  const Box alarm{200, 200, 10, 20, 0};
  const auto run = [&](float score) {
    return evaluate(truth, std::vector<Shown>{{0, {scored(alarm, score), scored(kPerson, 0.5F)}}})
        .ap50;
  };
  EXPECT_NEAR(run(0.4F), 1, 1e-12);
  EXPECT_NEAR(run(0.6F), 0.5, 1e-12);
}

TEST(Accuracy, SecondBoxOnAPersonIsAFalseAlarm) {
  const GroundTruth truth = {{0, {{kPerson}, {kOther}}}};
  // Precisions 1/1, 1/2, 2/3: recall 0 … .5 at 1, the rest at 2/3.
  const Accuracy a = evaluate(
      truth, std::vector<Shown>{
                 {0, {scored(kPerson, 0.9F), scored(kPerson, 0.8F), scored(kOther, 0.7F)}}});
  EXPECT_NEAR(a.ap50, (51 + 50 * 2.0 / 3) / 101, 1e-12);
}

TEST(Accuracy, IgnoreRegionsCountNeitherWay) {
  const GroundTruth truth = {{0, {{kOther, true}, {kPerson}}}};
  const Accuracy a = evaluate(
      truth,
      std::vector<Shown>{{0, {scored(kOther, 0.9F), scored(kOther, 0.8F), scored(kPerson, 0.7F)}}});
  EXPECT_EQ(a.truths, 1U);
  EXPECT_NEAR(a.ap50, 1, 1e-12);
}

TEST(Accuracy, APersonWinsOverAnIgnoreRegion) {
  // The ignore region overlaps the detection fully, the person by .75: the person is taken.
  const GroundTruth truth = {{0, {{{10, 10, 10, 15, 0}, true}, {kPerson}}}};
  const Accuracy a = evaluate(truth, std::vector<Shown>{{0, {{10, 10, 10, 15, 0.9F}}}});
  EXPECT_NEAR(a.recall50, 1, 1e-12);
}

TEST(Accuracy, AFrameShownTwiceCountsTwice) {
  const GroundTruth truth = {{0, {{kPerson}}}};
  const Accuracy a = evaluate(truth, std::vector<Shown>{{0, {scored(kPerson, 0.5F)}}, {0, {}}});
  EXPECT_EQ(a.truths, 2U);
  EXPECT_NEAR(a.recall50, 0.5, 1e-12);
}

TEST(Accuracy, SoManyTimesIsAsIfItWereListedSoOften) {
  const GroundTruth truth = {{0, {{kPerson}, {kOther}}}, {1, {{kOther}}}};
  const Shown a{0, {scored(kPerson, 0.5F), scored({300, 300, 5, 5, 0}, 0.6F)}};
  const Shown b{1, {scored(kOther, 0.7F), scored(kPerson, 0.4F)}};
  const Accuracy one_by_one = evaluate(truth, std::vector<Shown>{a, a, a, b, b});
  const Accuracy counted =
      evaluate(truth, std::vector<Shown>{{a.frame, a.boxes, 3}, {b.frame, b.boxes, 2}});
  EXPECT_EQ(counted.truths, one_by_one.truths);
  EXPECT_NEAR(counted.ap, one_by_one.ap, 1e-12);
  EXPECT_NEAR(counted.ar, one_by_one.ar, 1e-12);
  EXPECT_GT(counted.ap, 0);
}

TEST(Accuracy, OnlyTheBestHundredOfARoundCount) {
  std::vector<Box> boxes(100, {300, 300, 5, 5, 0.9F});
  boxes.push_back(scored(kPerson, 0.5F));
  EXPECT_EQ(evaluate({{0, {{kPerson}}}}, std::vector<Shown>{{0, boxes}}).recall50, 0);
}

TEST(ShareShown, CountsTheBoxesOfAScoreAndAbove) {
  const GroundTruth truth = {{0, {{kPerson}, {kOther}}}};
  const std::vector<Shown> rounds = {
      {0, {scored(kPerson, 0.5F), scored({300, 300, 5, 5, 0}, 0.3F)}}};
  const ShownShare all = share_shown(truth, rounds, 0);
  EXPECT_EQ(all.boxes, 2U);
  EXPECT_DOUBLE_EQ(all.precision, 0.5);
  EXPECT_DOUBLE_EQ(all.recall, 0.5);
  EXPECT_DOUBLE_EQ(share_shown(truth, rounds, 0.5F).precision, 1);
  EXPECT_EQ(share_shown(truth, rounds, 0.6F).boxes, 0U);
  EXPECT_EQ(share_shown(truth, rounds, 0.6F).precision, 0);
}

TEST(MotTruth, ReadsBoxesFromZeroAndIgnoreRegions) {
  const TempDir dir;
  write_text(dir / "gt.txt",
             "1,9,499,158,31.03,75.17,1,-4.1,-7.3,0\r\n1,3,2,3,4,5,0\n\n795,2,1,1,10,20,1\n");
  const GroundTruth truth = read_mot_truth(dir / "gt.txt");
  ASSERT_EQ(truth.size(), 2U);
  ASSERT_EQ(truth.at(0).size(), 2U);
  EXPECT_FLOAT_EQ(truth.at(0)[0].box.x, 498);
  EXPECT_FLOAT_EQ(truth.at(0)[0].box.y, 157);
  EXPECT_FLOAT_EQ(truth.at(0)[0].box.w, 31.03F);
  EXPECT_FALSE(truth.at(0)[0].ignore);
  EXPECT_TRUE(truth.at(0)[1].ignore);
  EXPECT_EQ(truth.at(794).size(), 1U);
}

TEST(MotTruth, SaysWhatIsWrongAndWhatToDo) {
  const TempDir dir;
  const auto complain = [&](const std::string& text) {
    write_text(dir / "gt.txt", text);
    return complaint([&] { read_mot_truth(dir / "gt.txt"); });
  };
  EXPECT_THAT(complain("1,9,499,158,31,75,1\n1,9,499\n"), HasSubstr("line 2"));
  EXPECT_THAT(complain("x,9,499,158,31,75,1\n"), HasSubstr("line 1"));
  EXPECT_THAT(complain("0,9,499,158,31,75,1\n"), HasSubstr("line 1"));
  EXPECT_THAT(complain("1e30,9,499,158,31,75,1\n"), HasSubstr("line 1"));
  EXPECT_THAT(complain(""), HasSubstr("no boxes"));
  EXPECT_THAT(complaint([&] { read_mot_truth(dir / "none.txt"); }),
              HasSubstr("scripts/fetch_data.sh"));
  EXPECT_THAT(complaint([&] { read_mot_truth(dir.path()); }), HasSubstr(dir.path().string()));
}

}  // namespace
}  // namespace interneuron::perception::accuracy_test
