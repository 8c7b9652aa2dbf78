// What vehicle and roadside unit send each other as messages: a request with an image, an image, a
// result, a point cloud. Any bytes; whatever is decoded must keep the bounds that its header says
// and be the same after another encoding. An input may take as long as a roadside unit can afford
// to give to one message, because the decoder is where a small message can cost the most.
#include <cmath>

#include "app/offload/offload_request.h"
#include "app/perception/codec.h"
#include "app/perception/detection.h"
#include "app/perception/point_cloud.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"

namespace {

using namespace interneuron;
using fuzz::require;

// The frame period of a camera of 10 frames a second is 100 ms, and sanitizers make what is ours
// about twice as slow; libjpeg, which takes most of the time, is not instrumented.
constexpr Duration kMostTime = std::chrono::milliseconds(200);

void try_image(ByteView bytes) {
  const auto image = perception::decode_image(bytes);
  if (!image) return;
  require(!image->bgr.empty() && image->bgr.type() == CV_8UC3, "an image has no pixels");
  require(image->source.width >= 1 && image->source.height >= 1, "an image has no source");
  if (perception::is_jpeg(image->variant)) {
    require(image->bgr.total() <= std::size_t{perception::kMaxJpegPixels}, "a JPEG is too large");
    return;
  }
  require(std::ranges::equal(perception::encode_image(*image), bytes),
          "an image has changed by being decoded");
}

// The pixels of the variants that have one size would be hundreds of kilobytes of input: what is
// missing of them is zeros.
void try_padded_image(ByteView bytes) {
  if (bytes.size() < perception::kImageHeaderBytes) return;
  const auto variant = std::to_integer<std::uint8_t>(bytes[3]);
  if (variant >= static_cast<std::uint8_t>(perception::Variant::kJpeg)) return;
  Bytes whole(bytes.begin(), bytes.end());
  whole.resize(perception::encoded_size(static_cast<perception::Variant>(variant)));
  try_image(whole);
}

void try_result(ByteView bytes) {
  const auto result = perception::decode_result(bytes);
  if (!result) return;
  require(result->boxes.size() <= perception::kMaxBoxes, "a result has too many boxes");
  for (const perception::Box& box : result->boxes) {
    require(std::isfinite(box.x) && std::isfinite(box.y) && box.w >= 0 && box.h >= 0 &&
                std::isfinite(box.w) && std::isfinite(box.h) && box.score >= 0 && box.score <= 1,
            "a box is out of bounds");
  }
  const auto again = perception::decode_result(perception::encode_result(*result));
  require(again && again->boxes.size() == result->boxes.size() && again->frame == result->frame,
          "a result cannot be encoded again");
}

void try_cloud(ByteView bytes) {
  const auto cloud = perception::decode_cloud(bytes);
  if (!cloud) return;
  require(cloud->points.allFinite(), "a point is not finite");
  require(std::ranges::equal(perception::encode_cloud(*cloud), bytes),
          "a cloud has changed by being decoded");
  if (cloud->points.cols() > 0) {
    perception::voxel_grid(cloud->points, 0.2);
    perception::stride(cloud->points, 3);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ByteView bytes = std::as_bytes(std::span(data, size));
  const fuzz::ProcessorTime time;
  if (const auto request = offload::parse_request(bytes)) try_image(request->second);
  try_image(bytes);
  if (bytes.size() >= 2 && bytes[0] == std::byte{'I'}) try_padded_image(bytes);
  try_result(bytes);
  try_cloud(bytes);
  time.require_at_most(kMostTime, "a message took too long");
  return 0;
}
