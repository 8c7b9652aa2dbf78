#include "app/perception/codec.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "app/perception/big_endian.h"

namespace interneuron::perception {
namespace {

// "IM", the first two bytes of an image message.
constexpr std::uint16_t kImageMagic = 0x494D;
constexpr std::uint8_t kImageVersion = 1;
// The longest side in pixels, because the sides of the source travel as 16 bits.
constexpr int kMaxSide = 0xFFFF;

constexpr std::array<std::string_view, kVariants> kVariantNames{
    "raw", "sampled", "grey", "jpeg", "jpeg-coarse", "jpeg-coarsest", "jpeg-half"};
constexpr std::array<Variant, 2> kPaperVariants{Variant::kRaw, Variant::kSampled};
constexpr std::array<Variant, 4> kJpegVariants{Variant::kJpeg, Variant::kJpegCoarse,
                                               Variant::kJpegCoarsest, Variant::kJpegHalf};

// The pixels of a variant that has one size.
cv::Size size_of(Variant variant) {
  return variant == Variant::kSampled ? cv::Size(kSampledWidth, kSampledHeight)
                                      : cv::Size(kRawWidth, kRawHeight);
}

[[maybe_unused]] bool valid_source(cv::Size size) {
  return size.width >= 1 && size.height >= 1 && size.width <= kMaxSide && size.height <= kMaxSide;
}

// A whole frame of at most kMaxJpegPixels, its sides divided.
cv::Mat shrunken(const cv::Mat& bgr, int divisor) {
  const double pixels = static_cast<double>(bgr.total());
  const double scale = std::min(1.0, std::sqrt(kMaxJpegPixels / pixels)) / divisor;
  if (scale >= 1) return bgr;
  cv::Mat out;
  cv::resize(bgr, out,
             {std::max(1, static_cast<int>(bgr.cols * scale)),
              std::max(1, static_cast<int>(bgr.rows * scale))},
             0, 0, cv::INTER_AREA);
  return out;
}

void append_pixels(Bytes& out, const cv::Mat& picture) {
  const auto row_bytes = static_cast<std::size_t>(picture.cols) * picture.elemSize();
  for (int y = 0; y < picture.rows; ++y) {
    const ByteView row = std::as_bytes(std::span(picture.ptr(y), row_bytes));
    out.insert(out.end(), row.begin(), row.end());
  }
}

void append_jpeg(Bytes& out, const cv::Mat& bgr, int quality) {
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", bgr, file, {cv::IMWRITE_JPEG_QUALITY, quality});
  const ByteView bytes = std::as_bytes(std::span(file));
  out.insert(out.end(), bytes.begin(), bytes.end());
}

// The pixels after the header, or an empty picture.
cv::Mat decode_pixels(Variant variant, cv::Size size, ByteView bytes) {
  cv::Mat picture(size, variant == Variant::kGrey ? CV_8UC1 : CV_8UC3);  // rows follow each other
  std::memcpy(picture.data, bytes.data(), bytes.size());
  if (variant == Variant::kGrey) cv::cvtColor(picture, picture, cv::COLOR_GRAY2BGR);
  return picture;
}

// What the header of an image message says, if the rest may belong to it.
struct Head {
  Image image;
  cv::Size size;
  ByteView rest;
};

std::optional<Head> parse_head(ByteView bytes) {
  ByteReader in(bytes);
  if (in.get<std::uint16_t>() != kImageMagic || in.get<std::uint8_t>() != kImageVersion) return {};
  const auto variant = in.get<std::uint8_t>();
  if (variant >= kVariants) return {};
  Head head;
  head.image.variant = static_cast<Variant>(variant);
  head.size = cv::Size{in.get<std::uint16_t>(), in.get<std::uint16_t>()};
  head.image.frame = in.get<std::uint32_t>();
  head.image.source.width = in.get<std::uint16_t>();
  head.image.source.height = in.get<std::uint16_t>();
  head.rest = in.rest();
  if (!in.ok() || head.image.source.width < 1 || head.image.source.height < 1) return {};
  if (is_jpeg(head.image.variant)) {
    return bytes.size() <= kMaxJpegBytes ? std::optional(head) : std::nullopt;
  }
  const bool fits =
      head.size == size_of(head.image.variant) && bytes.size() == encoded_size(head.image.variant);
  return fits ? std::optional(head) : std::nullopt;
}

}  // namespace

std::string_view to_string(Variant variant) {
  return kVariantNames[static_cast<std::size_t>(variant)];
}

std::optional<Variant> parse_variant(std::string_view text) {
  const auto* found = std::ranges::find(kVariantNames, text);
  if (found == kVariantNames.end()) return {};
  return static_cast<Variant>(found - kVariantNames.begin());
}

std::string_view to_string(Images images) { return images == Images::kPaper ? "paper" : "jpeg"; }

std::optional<Images> parse_images(std::string_view text) {
  for (const Images images : {Images::kPaper, Images::kJpeg}) {
    if (text == to_string(images)) return images;
  }
  return {};
}

std::span<const Variant> variants_of(Images images) {
  return images == Images::kPaper ? std::span<const Variant>(kPaperVariants) : kJpegVariants;
}

cv::Mat every_second_pixel(const cv::Mat& image) {
  assert(image.type() == CV_8UC3);
  cv::Mat out((image.rows + 1) / 2, (image.cols + 1) / 2, CV_8UC3);
  for (int y = 0; y < out.rows; ++y) {
    const auto* from = image.ptr<cv::Vec3b>(2 * y);
    auto* to = out.ptr<cv::Vec3b>(y);
    for (int x = 0; x < out.cols; ++x) to[x] = from[2 * x];
  }
  return out;
}

Image make_variant(const cv::Mat& bgr, std::uint32_t frame, Variant variant) {
  assert(bgr.type() == CV_8UC3 && valid_source(bgr.size()));
  Image image{.bgr = {}, .variant = variant, .frame = frame, .source = bgr.size()};
  if (is_jpeg(variant)) {
    image.bgr = shrunken(bgr, jpeg_form(variant).divisor);
    return image;
  }
  // By area, so that fine texture does not alias when a large camera picture shrinks.
  cv::resize(bgr, image.bgr, size_of(Variant::kRaw), 0, 0, cv::INTER_AREA);
  if (variant == Variant::kSampled) image.bgr = every_second_pixel(image.bgr);
  if (variant == Variant::kGrey) {
    cv::cvtColor(image.bgr, image.bgr, cv::COLOR_BGR2GRAY);
    cv::cvtColor(image.bgr, image.bgr, cv::COLOR_GRAY2BGR);
  }
  return image;
}

namespace {

// The header of an image message.
Bytes head_of(const Image& image) {
  assert(image.bgr.type() == CV_8UC3 && valid_source(image.source));
  assert(is_jpeg(image.variant) || image.bgr.size() == size_of(image.variant));
  Bytes out;
  out.reserve(encoded_size(image.variant));
  append(out, kImageMagic);
  append(out, kImageVersion);
  append(out, static_cast<std::uint8_t>(image.variant));
  append(out, static_cast<std::uint16_t>(image.bgr.cols));
  append(out, static_cast<std::uint16_t>(image.bgr.rows));
  append(out, image.frame);
  append(out, static_cast<std::uint16_t>(image.source.width));
  append(out, static_cast<std::uint16_t>(image.source.height));
  return out;
}

}  // namespace

Bytes encode_image(const Image& image) {
  Bytes out = head_of(image);
  if (is_jpeg(image.variant)) {
    append_jpeg(out, image.bgr, jpeg_form(image.variant).quality);
  } else if (image.variant == Variant::kGrey) {
    cv::Mat grey;
    cv::extractChannel(image.bgr, grey, 0);
    append_pixels(out, grey);
  } else {
    append_pixels(out, image.bgr);
  }
  return out;
}

Bytes encode_jpeg(const cv::Mat& bgr, std::uint32_t frame, const JpegForm& form) {
  const Image image{.bgr = shrunken(bgr, form.divisor),
                    .variant = Variant::kJpeg,
                    .frame = frame,
                    .source = bgr.size()};
  Bytes out = head_of(image);
  append_jpeg(out, image.bgr, form.quality);
  return out;
}

std::vector<Bytes> encode_variants(const cv::Mat& bgr, std::uint32_t frame,
                                   std::span<const Variant> variants) {
  std::vector<Bytes> out;
  for (const Variant variant : variants) {
    out.push_back(encode_image(make_variant(bgr, frame, variant)));
  }
  return out;
}

bool may_be_image(ByteView bytes) { return parse_head(bytes).has_value(); }

std::optional<Variant> claimed_variant(ByteView bytes) {
  const auto head = parse_head(bytes);
  return head ? std::optional(head->image.variant) : std::nullopt;
}

std::optional<Image> decode_image(ByteView bytes) {
  auto head = parse_head(bytes);
  if (!head) return {};
  Image& image = head->image;
  if (is_jpeg(image.variant)) {
    if (inspect_jpeg(head->rest).size != head->size) return {};
    image.bgr = decode_jpeg(head->rest).bgr;
  } else {
    image.bgr = decode_pixels(image.variant, head->size, head->rest);
  }
  if (image.bgr.empty()) return {};
  return image;
}

}  // namespace interneuron::perception
