// Images as messages: the paper's variants of a frame (raw, every second pixel, grey),
// uncompressed, and JPEG. The paper's have fixed sizes, so that the uplink carries what its does:
// raw is 512 KiB less 100 B, sampled a quarter of it, grey a third. JPEG comes in several forms,
// the rungs of a ladder, and its sizes depend on the frame; on the demo's video the best one is 11
// times smaller than raw at the same accuracy (docs/constants.md, "Images and detectors").
//
// Wire format, big-endian, a header of 16 bytes, then the pixels:
//
//   offset size field
//        0    2 magic 0x494D, "IM"
//        2    1 version, 1
//        3    1 variant: 0 raw, 1 sampled, 2 grey, 3 … 6 JPEG, the rungs of JpegForm
//        4    2 width, in pixels; 484 (raw, grey), 242 (sampled) or the file's (JPEG)
//        6    2 height; 361, 181 or the file's
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
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "app/perception/jpeg.h"
#include "interneuron/units.h"

namespace interneuron::perception {

// From kJpeg on: JPEG, better ones first; jpeg_form() says what each is.
enum class Variant : std::uint8_t {
  kRaw = 0,
  kSampled = 1,
  kGrey = 2,
  kJpeg = 3,
  kJpegCoarse = 4,
  kJpegCoarsest = 5,
  kJpegHalf = 6,
};
inline constexpr std::size_t kVariants = 7;
constexpr bool is_jpeg(Variant variant) { return variant >= Variant::kJpeg; }
// "raw", "sampled", "grey", "jpeg", "jpeg-coarse", "jpeg-coarsest", "jpeg-half".
std::string_view to_string(Variant variant);
std::optional<Variant> parse_variant(std::string_view text);

// Which variants of a frame are offered to be sent, `--images` of the programs.
enum class Images : std::uint8_t {
  // The paper's: raw, sampled.
  kPaper,
  // Four JPEGs.
  kJpeg,
};
// "paper" or "jpeg".
std::string_view to_string(Images images);
std::optional<Images> parse_images(std::string_view text);
// The variants, the best first, as they are to be submitted.
std::span<const Variant> variants_of(Images images);
// The ladder that a variant belongs to.
constexpr Images images_of(Variant variant) {
  return is_jpeg(variant) ? Images::kJpeg : Images::kPaper;
}

// The raw image in pixels: 484 x 361 x 3 bytes are 524,172 bytes, the paper's "512 KB".
inline constexpr int kRawWidth = 484;
inline constexpr int kRawHeight = 361;
// The sampled image has every second pixel of the raw one: 131,406 bytes, the paper's "128 KB".
inline constexpr int kSampledWidth = 242;
inline constexpr int kSampledHeight = 181;
inline constexpr std::size_t kImageHeaderBytes = 16;
// What a JPEG is made of: the frame made smaller by area, each side to 1/divisor, and the quality
// that libjpeg is told, 1 … 100.
struct JpegForm {
  int divisor = 1;
  int quality = 50;
};
// What each JPEG variant is: forms that no other one beats in both bytes and AP with the better
// nets (docs/constants.md, "Images and detectors").
constexpr JpegForm jpeg_form(Variant variant) {
  switch (variant) {
    case Variant::kJpegCoarse:
      return {1, 20};
    case Variant::kJpegCoarsest:
      return {1, 10};
    case Variant::kJpegHalf:
      return {2, 30};
    default:
      return {1, 50};
  }
}
// The most bytes of a whole message with a JPEG: one byte for each pixel, which the worst noise
// does not need at any quality of the ladder.
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
    default:
      return 0;
  }
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
// itself, made smaller where it has more than kMaxJpegPixels, and as its form says. Requires: bgr
// is 8 bits, 3 channels, 1 … 65535 pixels per side.
Image make_variant(const cv::Mat& bgr, std::uint32_t frame, Variant variant);

// Every second pixel per axis, starting with the first: 242 x 181 of 484 x 361.
cv::Mat every_second_pixel(const cv::Mat& image);

Bytes encode_image(const Image& image);
// The same of a JPEG in another form than its variant's, of a frame as make_variant() takes it.
Bytes encode_jpeg(const cv::Mat& bgr, std::uint32_t frame, const JpegForm& form);

// The named ones, or those of the paper, in this order. Requires as make_variant().
std::vector<Bytes> encode_variants(const cv::Mat& bgr, std::uint32_t frame,
                                   std::span<const Variant> variants = variants_of(Images::kPaper));

// Whether the bytes may be an image: their header and their number fit. Takes no longer for more
// bytes, so that nonsense is refused before a thread that decodes is bothered with it.
bool may_be_image(ByteView bytes);

// Which variant such bytes say they are; nothing where may_be_image() is false.
std::optional<Variant> claimed_variant(ByteView bytes);

// The image in a message, or nothing if the bytes are not exactly one, or a JPEG that jpeg.h
// refuses. Any bytes will do; never throws on them. The image owns a copy of the pixels. Takes up
// to JpegLimits::time.
std::optional<Image> decode_image(ByteView bytes);

}  // namespace interneuron::perception
