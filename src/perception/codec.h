// Images as messages: the paper's two variants of a frame, uncompressed. Sizes are fixed, so that
// the uplink carries what the paper's does: raw is 512 KiB less 100 B, sampled a quarter of it.
//
// Wire format, big-endian, a header of 16 bytes, then the pixels:
//
//   offset size field
//        0    2 magic 0x494D, "IM"
//        2    1 version, 1
//        3    1 variant: 0 raw, 1 sampled
//        4    2 width, in pixels; 484 (raw) or 242 (sampled)
//        6    2 height; 361 or 181
//        8    4 frame: 0-based index in the source
//       12    2 source width, in pixels, >= 1: boxes are expressed in pixels of the source
//       14    2 source height, >= 1
//       16    3·width·height: rows from the top, pixels from the left, bytes blue, green, red
//
// Pure functions: safe from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "interneuron/units.h"

namespace interneuron::perception {

// Also the index of the variant in encode_variants(): best first, as policies expect.
enum class Variant : std::uint8_t { kRaw = 0, kSampled = 1 };
inline constexpr std::size_t kVariants = 2;

inline constexpr int kRawWidth = 484;   // pixels; 484 x 361 x 3 B = 524,172 B, the paper's "512 KB"
inline constexpr int kRawHeight = 361;  // pixels; same
inline constexpr int kSampledWidth = 242;  // pixels; every second of the raw's: 131,406 B, "128 KB"
inline constexpr int kSampledHeight = 181;
inline constexpr std::size_t kImageHeaderBytes = 16;

// Bytes of the whole message.
constexpr std::size_t encoded_size(Variant variant) {
  const auto pixels =
      variant == Variant::kRaw ? kRawWidth * kRawHeight : kSampledWidth * kSampledHeight;
  return kImageHeaderBytes + 3 * static_cast<std::size_t>(pixels);
}

// One variant of one frame.
struct Image {
  cv::Mat bgr{};  // 8 bits, 3 channels; shared, like every cv::Mat: do not write to it
  Variant variant = Variant::kRaw;
  std::uint32_t frame = 0;    // 0-based index in the source
  cv::Size source{768, 576};  // pixels, 1 … 65535 each
};

// The variant of a frame: raw is the frame resized by area to 484 x 361, whatever its aspect;
// sampled is every second pixel of raw per axis. Requires: bgr is 8 bits, 3 channels, 1 … 65535
// pixels per side.
Image make_variant(const cv::Mat& bgr, std::uint32_t frame, Variant variant);

// Every second pixel per axis, starting with the first: 242 x 181 of 484 x 361.
cv::Mat every_second_pixel(const cv::Mat& image);

Bytes encode_image(const Image& image);

// {raw, sampled}. Requires as make_variant().
std::vector<Bytes> encode_variants(const cv::Mat& bgr, std::uint32_t frame);

// The image in a message, or nothing if the bytes are not exactly one. Any bytes will do; never
// throws on them. The image owns a copy of the pixels.
std::optional<Image> decode_image(ByteView bytes);

}  // namespace interneuron::perception
