// Decoding JPEG files that anybody may have sent, in bounded time.
//
// A file of a few kilobytes can keep a decoder busy for minutes: a progressive one may refine the
// same 8 million pixels in thousands of scans of 20 bytes each. So files are taken by an allow-list
// and refused before a decoder sees them: baseline (SOF0 of ITU T.81: sequential, 8 bits, Huffman),
// one or three components, at most JpegLimits::scans scans and JpegLimits::pixels pixels, no byte
// behind the end. Progressive, lossless, hierarchical and arithmetic ones are refused. What is left
// is decoded by libjpeg, which we call ourselves, because OpenCV's imdecode() can neither be
// stopped nor says that it has made up pixels for damaged data: here the first doubt of libjpeg
// refuses the file, and its progress monitor ends a decoding that takes too long.
//
// Reads the steady clock for that. Any bytes will do, nothing is thrown on them; memory is at most
// 25 bytes for each pixel allowed (the picture, the coefficients of several scans, one row of
// blocks). Safe from any thread.
#pragma once

#include <opencv2/core.hpp>
#include <string_view>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::perception {

// The most pixels of a JPEG: a camera of 1920 x 1080. Larger frames are made smaller before they
// are sent, larger files refused.
inline constexpr int kMaxJpegPixels = 1920 * 1080;

struct JpegLimits {
  int pixels = kMaxJpegPixels;
  // One scan holds all components; three hold one each, and a fourth does no harm.
  int scans = 4;
  // How long decoding may take, by the clock on the wall, since that is how long others wait for
  // the thread. Three times what the worst sound file takes, nine times what a camera's does
  // (docs/constants.md, "Images and detectors"), and less than half of a round's deadline of
  // 130 ms: an image that takes longer on a busy machine would be late anyway.
  Duration time = std::chrono::milliseconds(50);
};

enum class JpegFault {
  kNone,
  // Progressive, arithmetic, lossless, hierarchical, or not of one or three components.
  kNotBaseline,
  kTooManyPixels,
  kTooManyScans,
  // The bytes are no sound JPEG file.
  kDamaged,
  // Decoding was given up.
  kTooSlow,
};
// "sound", "not baseline", "too many pixels", "too many scans", "damaged", "too slow".
std::string_view to_string(JpegFault fault);

// What a file says of itself, read from its markers alone, in time linear in its bytes.
struct JpegHead {
  cv::Size size{};
  int scans = 0;
  JpegFault fault = JpegFault::kNone;
};
JpegHead inspect_jpeg(ByteView file, const JpegLimits& limits = {});

struct JpegPicture {
  // 8 bits, blue, green, red; empty where there is a fault.
  cv::Mat bgr{};
  JpegFault fault = JpegFault::kNone;
};
JpegPicture decode_jpeg(ByteView file, const JpegLimits& limits = {});

}  // namespace interneuron::perception
