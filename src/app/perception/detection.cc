#include "app/perception/detection.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "app/perception/big_endian.h"

namespace interneuron::perception {
namespace {

// "DX", the first two bytes of a result message.
constexpr std::uint16_t kDetectionsMagic = 0x4458;
constexpr std::uint8_t kDetectionsVersion = 1;
constexpr std::uint8_t kFlagLate = 1;
constexpr std::uint8_t kFlagReleased = 2;
// Steps of a quantity of 16 bits, and of one of 8.
constexpr double kSteps = 65535.0;
constexpr double kByteSteps = 255.0;
// Coordinates reach half a frame beyond the frame on either side, so they span two frames.
constexpr double kOutside = 0.5;
constexpr double kFullRange = 2.0;

// The step of `steps` that is nearest to `fraction` (0 … 1); NaN becomes 0.
double step_of(double fraction, double steps) {
  const double step = std::round(fraction * steps);
  return step > 0 ? std::min(step, steps) : 0;
}

// `value` as a step of `range`.
std::uint16_t quantise(double value, double range) {
  return static_cast<std::uint16_t>(step_of(value / range, kSteps));
}

float restore(std::uint16_t step, double range, double offset) {
  return static_cast<float>(step * range / kSteps - offset);
}

bool better(const Box& a, const Box& b) {
  // NaN last, so that the order is strict and weak whatever a detector says.
  if (std::isnan(a.score) || std::isnan(b.score))
    return !std::isnan(a.score) && std::isnan(b.score);
  return a.score > b.score;
}

double area(const Box& box) { return double{box.w} * box.h; }

double shared_area(const Box& a, const Box& b) {
  const double width = std::min(double{a.x} + a.w, double{b.x} + b.w) - std::max(a.x, b.x);
  const double height = std::min(double{a.y} + a.h, double{b.y} + b.h) - std::max(a.y, b.y);
  return width > 0 && height > 0 ? width * height : 0;
}

}  // namespace

Bytes encode_result(const Result& result) {
  assert(result.source.width >= 1 && result.source.height >= 1);
  std::vector<Box> boxes = result.boxes;
  std::stable_sort(boxes.begin(), boxes.end(), better);
  if (boxes.size() > kMaxBoxes) boxes.resize(kMaxBoxes);

  Bytes out;
  out.reserve(kResultHeaderBytes + kBoxBytes * boxes.size());
  append(out, kDetectionsMagic);
  append(out, kDetectionsVersion);
  append(out, result.level);
  append(out, static_cast<std::uint8_t>(result.variant));
  append(out, static_cast<std::uint8_t>((result.stage1_late ? kFlagLate : 0) |
                                        (result.stage1_released ? kFlagReleased : 0)));
  append(out, static_cast<std::uint8_t>(step_of(result.draw_score, kByteSteps)));
  append(out, static_cast<std::uint8_t>(boxes.size()));
  append(out, result.frame);
  append(out, static_cast<std::uint16_t>(result.source.width));
  append(out, static_cast<std::uint16_t>(result.source.height));
  append(out, static_cast<std::int64_t>(result.stage1_overrun.count()));
  append(out, static_cast<std::int64_t>(result.compute_time.count()));
  const double width = result.source.width;
  const double height = result.source.height;
  for (const Box& box : boxes) {
    append(out, quantise(box.x + kOutside * width, kFullRange * width));
    append(out, quantise(box.y + kOutside * height, kFullRange * height));
    append(out, quantise(box.w, kFullRange * width));
    append(out, quantise(box.h, kFullRange * height));
    append(out, quantise(box.score, 1.0));
  }
  return out;
}

std::optional<Result> decode_result(ByteView bytes) {
  ByteReader in(bytes);
  if (in.get<std::uint16_t>() != kDetectionsMagic || in.get<std::uint8_t>() != kDetectionsVersion)
    return {};
  Result result{.level = in.get<std::uint8_t>()};
  const auto variant = in.get<std::uint8_t>();
  const auto flags = in.get<std::uint8_t>();
  result.draw_score = static_cast<float>(in.get<std::uint8_t>() / kByteSteps);
  const std::size_t count = in.get<std::uint8_t>();
  result.frame = in.get<std::uint32_t>();
  result.source.width = in.get<std::uint16_t>();
  result.source.height = in.get<std::uint16_t>();
  result.stage1_overrun = std::chrono::microseconds{in.get<std::int64_t>()};
  result.compute_time = std::chrono::microseconds{in.get<std::int64_t>()};
  if (!in.ok() || variant >= kVariants || (flags & ~(kFlagLate | kFlagReleased)) != 0) return {};
  if (result.source.width < 1 || result.source.height < 1 || count > kMaxBoxes) return {};
  if (in.rest().size() != count * kBoxBytes) return {};
  result.variant = static_cast<Variant>(variant);
  result.stage1_late = (flags & kFlagLate) != 0;
  result.stage1_released = (flags & kFlagReleased) != 0;
  const double width = result.source.width;
  const double height = result.source.height;
  result.boxes.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    Box box;
    box.x = restore(in.get<std::uint16_t>(), kFullRange * width, kOutside * width);
    box.y = restore(in.get<std::uint16_t>(), kFullRange * height, kOutside * height);
    box.w = restore(in.get<std::uint16_t>(), kFullRange * width, 0);
    box.h = restore(in.get<std::uint16_t>(), kFullRange * height, 0);
    box.score = restore(in.get<std::uint16_t>(), 1.0, 0);
    if (i > 0 && box.score > result.boxes.back().score) return {};
    result.boxes.push_back(box);
  }
  return result;
}

double iou(const Box& a, const Box& b) {
  const double both = shared_area(a, b);
  return both > 0 ? both / (area(a) + area(b) - both) : 0;
}

std::vector<Box> drop_nested(std::vector<Box> boxes, double max_share) {
  std::stable_sort(boxes.begin(), boxes.end(), better);
  std::vector<Box> kept;
  for (const Box& box : boxes) {
    const bool nested = std::any_of(kept.begin(), kept.end(), [&](const Box& k) {
      return shared_area(box, k) > max_share * std::min(area(box), area(k));
    });
    if (!nested) kept.push_back(box);
  }
  return kept;
}

std::vector<Box> suppress(std::vector<Box> boxes, float max_iou, float min_score,
                          std::size_t limit) {
  std::erase_if(boxes, [&](const Box& box) { return !(box.score >= min_score); });
  std::stable_sort(boxes.begin(), boxes.end(), better);
  std::vector<Box> kept;
  for (const Box& box : boxes) {
    if (kept.size() >= limit) break;
    const bool covered =
        std::any_of(kept.begin(), kept.end(), [&](const Box& k) { return iou(box, k) > max_iou; });
    if (!covered) kept.push_back(box);
  }
  return kept;
}

}  // namespace interneuron::perception
