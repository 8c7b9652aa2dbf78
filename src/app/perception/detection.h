// What a detector finds, and the message that carries it back to the vehicle.
//
// Wire format, big-endian, a header of 32 bytes, then the boxes, best score first:
//
//   offset size field
//        0    2 magic 0x4458, "DX"
//        2    1 version, 1
//        3    1 level of the ladder that ran
//        4    1 variant of the image it ran on: 0 raw, 1 sampled, 2 grey, 3 … 6 JPEG
//        5    1 flags: bit 0 stage 1 was late, bit 1 it was released at its deadline, rest 0
//        6    1 score from which boxes are worth drawing, in units of 1/255
//        7    1 number of boxes, 0 … 100
//        8    4 frame: 0-based index in the source
//       12    2 source width, in pixels, >= 1
//       14    2 source height, >= 1
//       16    8 stage 1's overrun, microseconds, signed
//       24    8 compute time, microseconds, signed
//       32   10 per box: x, y, w, h, score, 2 bytes each
//
// x and w are in units of 2·(source width)/65535, y and h of 2·(source height)/65535; x and y count
// from half a frame left of and above the frame, since boxes may stick out of it. The score is in
// units of 1/65535. For a source 768 pixels wide a step is 0.023 pixels, less than any detector's
// own error.
//
// Pure functions: safe from any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "app/perception/codec.h"
#include "interneuron/units.h"

namespace interneuron::perception {

// A person, in pixels of the source frame; x and y are the left upper corner.
struct Box {
  float x = 0;
  float y = 0;
  float w = 0;
  float h = 0;
  // How sure the detector is, 0 … 1; comparable only within one level.
  float score = 0;
  friend bool operator==(const Box&, const Box&) = default;
};

// The most boxes of a result; COCO's evaluation counts no more (maxDets).
inline constexpr std::size_t kMaxBoxes = 100;
// No result is larger than this, so that it fits into four packets.
inline constexpr std::size_t kMaxResultBytes = 5000;
inline constexpr std::size_t kResultHeaderBytes = 32;
inline constexpr std::size_t kBoxBytes = 10;
static_assert(kResultHeaderBytes + kMaxBoxes * kBoxBytes <= kMaxResultBytes);

// What one level found in one image, with the roadside's notes for plots.
struct Result {
  // 0-based index in the source.
  std::uint32_t frame = 0;
  // The level of the ladder that ran.
  std::uint8_t level = 0;
  Variant variant = Variant::kRaw;
  // Boxes scored below this are guesses and are not drawn; 0 … 1, 0 draws all. It is the level's
  // Level::draw_score, and travels with the result because only the detector's side knows it.
  float draw_score = 0;
  // Width and height of the source's frames in pixels, 1 … 65535 each.
  cv::Size source{768, 576};
  // Whether the image arrived after D1, the deadline of the first stage.
  bool stage1_late = false;
  // Whether a degraded variant was released at D1 because the full one had not arrived.
  bool stage1_released = false;
  // How long after D1 the image arrived (θ1 - D1); negative when it was early.
  std::chrono::microseconds stage1_overrun{};
  std::chrono::microseconds compute_time{};
  std::vector<Box> boxes{};
};

// Requires: source as Image's. Keeps the kMaxBoxes best-scored boxes; clamps what the format cannot
// say (a box further out than half a frame, wider than two frames, a score outside 0 … 1, NaN as
// 0).
Bytes encode_result(const Result& result);

// The result in a message, or nothing if the bytes are not exactly one. Any bytes will do; never
// throws on them. Every box it yields is finite, with w, h >= 0 and 0 <= score <= 1, best score
// first.
std::optional<Result> decode_result(ByteView bytes);

// Greedy non-maximum suppression: drops the boxes below `min_score` and those that overlap a
// better-scored one by more than `max_iou`; returns at most `limit`, best first.
std::vector<Box> suppress(std::vector<Box> boxes, float max_iou, float min_score,
                          std::size_t limit = kMaxBoxes);

// Drops boxes that lie in or around a better-scored one: those that share more than `max_share` of
// the smaller box's area with it. Suppression by intersection over union misses them, because the
// larger box of such a pair is mostly background. Returns the boxes best first.
std::vector<Box> drop_nested(std::vector<Box> boxes, double max_share);

// Intersection over union, 0 … 1.
double iou(const Box& a, const Box& b);

}  // namespace interneuron::perception
