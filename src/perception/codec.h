// Images as messages: the paper's variants of a frame (raw, every second pixel, grey),
// uncompressed, and JPEG. The paper's have fixed sizes, so that the uplink carries what its does:
// raw is 512 KiB less 100 B, sampled a quarter of it, grey a third. JPEG holds the whole frame; on
// the demo's video it is 7 times smaller than raw at the same accuracy (docs/constants.md, "Images
// and detectors").
//
// Wire format, big-endian, a header of 16 bytes, then the pixels:
//
//   offset size field
//        0    2 magic 0x494D, "IM"
//        2    1 version, 1
//        3    1 variant: 0 raw, 1 sampled, 2 grey, 3 JPEG
//        4    2 width, in pixels; 484 (raw, grey), 242 (sampled) or the source's (JPEG)
//        6    2 height; 361, 181 or the source's
//        8    4 frame: 0-based index in the source
//       12    2 source width, in pixels, >= 1: boxes are expressed in pixels of the source
//       14    2 source height, >= 1
//       16    raw, sampled: 3·width·height: rows from the top, pixels from the left, bytes blue,
//             green, red; grey: width·height, likewise; JPEG: a file of that size
//
// Pure functions, but for the clock that limits the decoding of a JPEG: safe from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "interneuron/units.h"
#include "perception/jpeg.h"

namespace interneuron::perception {

enum class Variant : std::uint8_t { kRaw = 0, kSampled = 1, kGrey = 2, kJpeg = 3 };
inline constexpr std::size_t kVariants = 4;

// The raw image in pixels: 484 x 361 x 3 bytes are 524,172 bytes, the paper's "512 KB".
inline constexpr int kRawWidth = 484;
inline constexpr int kRawHeight = 361;
// The sampled image has every second pixel of the raw one: 131,406 bytes, the paper's "128 KB".
inline constexpr int kSampledWidth = 242;
inline constexpr int kSampledHeight = 181;
inline constexpr std::size_t kImageHeaderBytes = 16;
// A frame of the demo's video has 76 KB at this quality (docs/constants.md, "Images and
// detectors").
inline constexpr int kJpegQuality = 80;
// The most bytes of a whole message with a JPEG: one byte for each pixel, which the worst noise
// does not need at this quality.
inline constexpr std::size_t kMaxJpegBytes = kImageHeaderBytes + kMaxJpegPixels;

// Bytes of the whole message; 0 for JPEG, whose size depends on the frame.
constexpr std::size_t encoded_size(Variant variant) {
  constexpr std::size_t kRawPixels = std::size_t{kRawWidth} * kRawHeight;
  constexpr std::size_t kSampledPixels = std::size_t{kSampledWidth} * kSampledHeight;
  switch (variant) {
    case Variant::kRaw:
      return kImageHeaderBytes + 3 * kRawPixels;
    case Variant::kSampled:
      return kImageHeaderBytes + 3 * kSampledPixels;
    case Variant::kGrey:
      return kImageHeaderBytes + kRawPixels;
    case Variant::kJpeg:
      break;
  }
  return 0;
}

// One variant of one frame.
struct Image {
  // 8 bits and 3 channels, which are equal in a grey image. Copies share the pixels: nobody writes
  // to them.
  cv::Mat bgr{};
  Variant variant = Variant::kRaw;
  // The index in the source, from 0.
  std::uint32_t frame = 0;
  // The sides of the frame that the image was made of, in pixels: 1 … 65535 each.
  cv::Size source{768, 576};
  // Whom the image is of; not in the message, but set by who received it. What detectors learn from
  // an image serves this sender alone. 0 on the sender's own host.
  std::uint32_t sender = 0;
};

// The variant of a frame: raw is the frame resized by area to 484 x 361, whatever its aspect;
// sampled is every second pixel of raw per axis, grey is raw without colours; JPEG is the frame
// itself, made smaller only where it has more than kMaxJpegPixels. Requires: bgr is 8 bits, 3
// channels, 1 … 65535 pixels per side.
Image make_variant(const cv::Mat& bgr, std::uint32_t frame, Variant variant);

// Every second pixel per axis, starting with the first: 242 x 181 of 484 x 361.
cv::Mat every_second_pixel(const cv::Mat& image);

Bytes encode_image(const Image& image);

// {raw, sampled}, or those named; to be submitted, name the best first. Requires as make_variant().
std::vector<Bytes> encode_variants(const cv::Mat& bgr, std::uint32_t frame,
                                   std::initializer_list<Variant> variants = {Variant::kRaw,
                                                                              Variant::kSampled});

// Whether the bytes may be an image: their header and their number fit. Takes no longer for more
// bytes, so that nonsense is refused before a thread that decodes is bothered with it.
bool may_be_image(ByteView bytes);

// The image in a message, or nothing if the bytes are not exactly one, or a JPEG that jpeg.h
// refuses. Any bytes will do; never throws on them. The image owns a copy of the pixels. Takes up
// to JpegLimits::time.
std::optional<Image> decode_image(ByteView bytes);

}  // namespace interneuron::perception
