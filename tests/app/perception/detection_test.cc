#include "app/perception/detection.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace interneuron::perception::detection_test {
namespace {

Result example() {
  return {.frame = 794,
          .level = 2,
          .variant = Variant::kSampled,
          .draw_score = 0.4F,
          .source = {768, 576},
          .stage1_late = true,
          .stage1_released = true,
          .stage1_overrun = std::chrono::microseconds{-12'345},
          .compute_time = std::chrono::microseconds{44'000},
          .boxes = {{641.4F, 239.6F, 42.3F, 82.6F, 0.862F}, {-3.0F, 110.5F, 19.1F, 31.1F, 0.3F}}};
}

float within(float low, float high) {
  const int step = *rc::gen::inRange(0, 1'000'001);
  return low + (high - low) * static_cast<float>(step) / 1e6F;
}

Result any_result() {
  Result r;
  r.frame = *rc::gen::arbitrary<std::uint32_t>();
  r.level = *rc::gen::arbitrary<std::uint8_t>();
  r.variant = *rc::gen::arbitrary<bool>() ? Variant::kRaw : Variant::kSampled;
  r.source = {*rc::gen::inRange(1, 65536), *rc::gen::inRange(1, 65536)};
  r.stage1_late = *rc::gen::arbitrary<bool>();
  r.stage1_released = *rc::gen::arbitrary<bool>();
  r.stage1_overrun = std::chrono::microseconds{*rc::gen::arbitrary<std::int64_t>()};
  r.compute_time = std::chrono::microseconds{*rc::gen::arbitrary<std::int64_t>()};
  const auto w = static_cast<float>(r.source.width);
  const auto h = static_cast<float>(r.source.height);
  const int boxes = *rc::gen::inRange(0, 120);
  for (int i = 0; i < boxes; ++i) {
    r.boxes.push_back({within(-0.5F * w, 1.5F * w), within(-0.5F * h, 1.5F * h), within(0, 2 * w),
                       within(0, 2 * h), within(0, 1)});
  }
  return r;
}

TEST(ResultMessage, RoundTrip) {
  const auto back = decode_result(encode_result(example()));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->frame, 794U);
  EXPECT_EQ(back->level, 2);
  EXPECT_EQ(back->variant, Variant::kSampled);
  EXPECT_EQ(back->source, cv::Size(768, 576));
  EXPECT_FLOAT_EQ(back->draw_score, 0.4F);
  EXPECT_TRUE(back->stage1_late);
  EXPECT_TRUE(back->stage1_released);
  EXPECT_EQ(back->stage1_overrun.count(), -12'345);
  EXPECT_EQ(back->compute_time.count(), 44'000);
  ASSERT_EQ(back->boxes.size(), 2U);
  EXPECT_NEAR(back->boxes[0].x, 641.4, 0.012);
  EXPECT_NEAR(back->boxes[0].y, 239.6, 0.012);
  EXPECT_NEAR(back->boxes[0].w, 42.3, 0.012);
  EXPECT_NEAR(back->boxes[0].h, 82.6, 0.012);
  EXPECT_NEAR(back->boxes[0].score, 0.862, 1e-5);
  EXPECT_NEAR(back->boxes[1].x, -3, 0.012);
}

RC_GTEST_PROP(ResultMessage, RoundTripKeepsAllWithinHalfAStep, ()) {
  const Result in = any_result();
  const Bytes bytes = encode_result(in);
  RC_ASSERT(bytes.size() <= kMaxResultBytes);
  const auto out = decode_result(bytes);
  RC_ASSERT(out.has_value());
  RC_ASSERT(out->frame == in.frame && out->level == in.level && out->variant == in.variant);
  RC_ASSERT(out->source == in.source);
  RC_ASSERT(out->stage1_late == in.stage1_late && out->stage1_released == in.stage1_released);
  RC_ASSERT(out->stage1_overrun == in.stage1_overrun && out->compute_time == in.compute_time);
  std::vector<Box> best = in.boxes;
  std::stable_sort(best.begin(), best.end(),
                   [](const Box& a, const Box& b) { return a.score > b.score; });
  best.resize(std::min(best.size(), kMaxBoxes));
  RC_ASSERT(out->boxes.size() == best.size());
  // Half a step is 1/65535 of a side; the rest is the rounding of float.
  const float tx = 1.2e-5F * static_cast<float>(in.source.width) * 1.4F;
  const float ty = 1.2e-5F * static_cast<float>(in.source.height) * 1.4F;
  for (std::size_t i = 0; i < best.size(); ++i) {
    RC_ASSERT(std::abs(out->boxes[i].x - best[i].x) <= tx);
    RC_ASSERT(std::abs(out->boxes[i].y - best[i].y) <= ty);
    RC_ASSERT(std::abs(out->boxes[i].w - best[i].w) <= tx);
    RC_ASSERT(std::abs(out->boxes[i].h - best[i].h) <= ty);
    RC_ASSERT(std::abs(out->boxes[i].score - best[i].score) <= 1e-5F);
  }
}

TEST(ResultMessage, EncodingIsStable) {
  const Bytes once = encode_result(example());
  EXPECT_EQ(encode_result(*decode_result(once)), once);
}

TEST(ResultMessage, HundredBoxesFitAndTheBestStay) {
  Result result;
  for (int i = 0; i < 300; ++i)
    result.boxes.push_back({0, 0, 1, 1, static_cast<float>(i) / 300.0F});
  const Bytes bytes = encode_result(result);
  EXPECT_LE(bytes.size(), kMaxResultBytes);
  const auto back = decode_result(bytes);
  ASSERT_TRUE(back);
  ASSERT_EQ(back->boxes.size(), kMaxBoxes);
  EXPECT_NEAR(back->boxes.front().score, 299.0 / 300, 1e-4);
  EXPECT_NEAR(back->boxes.back().score, 200.0 / 300, 1e-4);
}

TEST(ResultMessage, ClampsWhatTheFormatCannotSay) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const Result in{.boxes = {{kInf, -kInf, -5, 1e30F, 7}, {kNan, kNan, kNan, kNan, kNan}}};
  const auto out = decode_result(encode_result(in));
  ASSERT_TRUE(out);
  ASSERT_EQ(out->boxes.size(), 2U);
  for (const Box& box : out->boxes) {
    EXPECT_TRUE(std::isfinite(box.x) && std::isfinite(box.y));
    EXPECT_TRUE(box.w >= 0 && box.h >= 0 && box.score >= 0 && box.score <= 1);
  }
}

TEST(ResultMessage, RejectsEveryTruncationAndExtension) {
  Bytes bytes = encode_result(example());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode_result(ByteView(bytes).first(size))) << size;
  }
  bytes.push_back(std::byte{0});
  EXPECT_FALSE(decode_result(bytes));
}

RC_GTEST_PROP(ResultMessage, AnyBytesGiveAValidResultOrNothing, (std::vector<std::uint8_t> noise)) {
  Bytes bytes = encode_result(example());
  for (std::size_t i = 0; i < noise.size() && i < 6; ++i) {
    bytes[(noise[i] * 7U + i) % bytes.size()] = static_cast<std::byte>(noise[noise.size() - 1 - i]);
  }
  if (const auto result = decode_result(bytes)) RC_ASSERT(encode_result(*result) == bytes);
  (void)decode_result(std::as_bytes(std::span(noise)));
}

TEST(Iou, OfKnownBoxes) {
  const Box box{0, 0, 10, 10};
  EXPECT_DOUBLE_EQ(iou(box, box), 1);
  EXPECT_DOUBLE_EQ(iou(box, {5, 0, 10, 10}), 50.0 / 150);
  EXPECT_DOUBLE_EQ(iou(box, {10, 0, 10, 10}), 0);
  EXPECT_DOUBLE_EQ(iou({0, 0, 0, 0}, {0, 0, 0, 0}), 0);
}

TEST(Suppress, KeepsTheBestOfEachCluster) {
  const std::vector<Box> boxes = {
      {0, 0, 10, 10, 0.5F}, {1, 0, 10, 10, 0.9F}, {50, 0, 10, 10, 0.4F}, {90, 0, 10, 10, 0.01F}};
  const auto kept = suppress(boxes, 0.5F, 0.02F);
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_EQ(kept[0], boxes[1]);
  EXPECT_EQ(kept[1], boxes[2]);
  EXPECT_EQ(suppress(boxes, 0.5F, 0.02F, 1).size(), 1U);
}

TEST(DropNested, DropsWhatLiesInOrAroundABetterBox) {
  const Box person{20, 20, 10, 20, 0.8F};
  const Box around_two{15, 15, 40, 40, 0.5F};
  const Box half{20, 20, 10, 10, 0.4F};
  const Box neighbour{26, 20, 10, 20, 0.3F};
  EXPECT_EQ(drop_nested({half, around_two, person, neighbour}, 0.7),
            (std::vector<Box>{person, neighbour}));
  // The best score wins, whichever box is the larger.
  EXPECT_EQ(drop_nested({{15, 15, 40, 40, 0.9F}, person}, 0.7).size(), 1U);
  EXPECT_TRUE(drop_nested({}, 0.7).empty());
}

}  // namespace
}  // namespace interneuron::perception::detection_test
