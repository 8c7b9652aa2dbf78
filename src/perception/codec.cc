#include "perception/codec.h"

#include <cassert>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "perception/big_endian.h"

namespace interneuron::perception {
namespace {

constexpr std::uint16_t kMagic = 0x494D;  // "IM"
constexpr std::uint8_t kVersion = 1;
constexpr int kMaxSide = 0xFFFF;  // pixels; the source's sides travel as 16 bits

cv::Size size_of(Variant variant) {
  return variant == Variant::kRaw ? cv::Size(kRawWidth, kRawHeight)
                                  : cv::Size(kSampledWidth, kSampledHeight);
}

[[maybe_unused]] bool valid_source(cv::Size size) {
  return size.width >= 1 && size.height >= 1 && size.width <= kMaxSide && size.height <= kMaxSide;
}

}  // namespace

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
  // By area, so that fine texture does not alias when a large camera picture shrinks.
  cv::resize(bgr, image.bgr, size_of(Variant::kRaw), 0, 0, cv::INTER_AREA);
  if (variant == Variant::kSampled) image.bgr = every_second_pixel(image.bgr);
  return image;
}

Bytes encode_image(const Image& image) {
  assert(image.bgr.type() == CV_8UC3 && image.bgr.size() == size_of(image.variant));
  assert(valid_source(image.source));
  Bytes out;
  out.reserve(encoded_size(image.variant));
  append(out, kMagic);
  append(out, kVersion);
  append(out, static_cast<std::uint8_t>(image.variant));
  append(out, static_cast<std::uint16_t>(image.bgr.cols));
  append(out, static_cast<std::uint16_t>(image.bgr.rows));
  append(out, image.frame);
  append(out, static_cast<std::uint16_t>(image.source.width));
  append(out, static_cast<std::uint16_t>(image.source.height));
  const auto row_bytes = static_cast<std::size_t>(image.bgr.cols) * image.bgr.elemSize();
  for (int y = 0; y < image.bgr.rows; ++y) {
    const ByteView row = std::as_bytes(std::span(image.bgr.ptr(y), row_bytes));
    out.insert(out.end(), row.begin(), row.end());
  }
  return out;
}

std::vector<Bytes> encode_variants(const cv::Mat& bgr, std::uint32_t frame) {
  const Image raw = make_variant(bgr, frame, Variant::kRaw);
  Image sampled = raw;
  sampled.variant = Variant::kSampled;
  sampled.bgr = every_second_pixel(raw.bgr);
  return {encode_image(raw), encode_image(sampled)};
}

std::optional<Image> decode_image(ByteView bytes) {
  ByteReader in(bytes);
  if (in.get<std::uint16_t>() != kMagic || in.get<std::uint8_t>() != kVersion) return {};
  const auto variant = in.get<std::uint8_t>();
  if (variant >= kVariants) return {};
  Image image;
  image.variant = static_cast<Variant>(variant);
  const cv::Size size = size_of(image.variant);
  if (in.get<std::uint16_t>() != size.width || in.get<std::uint16_t>() != size.height) return {};
  image.frame = in.get<std::uint32_t>();
  image.source.width = in.get<std::uint16_t>();
  image.source.height = in.get<std::uint16_t>();
  if (!in.ok() || image.source.width < 1 || image.source.height < 1) return {};
  if (bytes.size() != encoded_size(image.variant)) return {};
  image.bgr.create(size, CV_8UC3);  // continuous, so the rows follow each other
  std::memcpy(image.bgr.data, in.rest().data(), in.rest().size());
  return image;
}

}  // namespace interneuron::perception
