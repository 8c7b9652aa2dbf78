#include "perception/detection.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "perception/big_endian.h"

namespace interneuron::perception {
namespace {

constexpr std::uint16_t kMagic = 0x4458;  // "DX"
constexpr std::uint8_t kVersion = 1;
constexpr std::uint8_t kFlagLate = 1;
constexpr std::uint8_t kFlagReleased = 2;
constexpr double kSteps = 65535.0;  // of a 16-bit quantity
constexpr double kOutside = 0.5;    // of a frame, on either side of it
constexpr double kFullRange = 2.0;  // frames that a coordinate or size can span

// `value` as a step of `range`; NaN becomes 0.
std::uint16_t quantise(double value, double range) {
  const double step = std::round(value / range * kSteps);
  return step > 0 ? static_cast<std::uint16_t>(std::min(step, kSteps)) : std::uint16_t{0};
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

}  // namespace

Bytes encode_result(const Result& result) {
  assert(result.source.width >= 1 && result.source.height >= 1);
  std::vector<Box> boxes = result.boxes;
  std::stable_sort(boxes.begin(), boxes.end(), better);
  if (boxes.size() > kMaxBoxes) boxes.resize(kMaxBoxes);

  Bytes out;
  out.reserve(kResultHeaderBytes + kBoxBytes * boxes.size());
  append(out, kMagic);
  append(out, kVersion);
  append(out, result.level);
  append(out, static_cast<std::uint8_t>(result.variant));
  append(out, static_cast<std::uint8_t>((result.stage1_late ? kFlagLate : 0) |
                                        (result.stage1_released ? kFlagReleased : 0)));
  append(out, static_cast<std::uint16_t>(boxes.size()));
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
  if (in.get<std::uint16_t>() != kMagic || in.get<std::uint8_t>() != kVersion) return {};
  Result result;
  result.level = in.get<std::uint8_t>();
  const auto variant = in.get<std::uint8_t>();
  const auto flags = in.get<std::uint8_t>();
  const std::size_t count = in.get<std::uint16_t>();
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
  const double width = std::min(double{a.x} + a.w, double{b.x} + b.w) - std::max(a.x, b.x);
  const double height = std::min(double{a.y} + a.h, double{b.y} + b.h) - std::max(a.y, b.y);
  if (!(width > 0 && height > 0)) return 0;
  const double both = width * height;
  return both / (double{a.w} * a.h + double{b.w} * b.h - both);
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
