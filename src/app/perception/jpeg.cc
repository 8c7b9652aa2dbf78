#include "app/perception/jpeg.h"

#include <chrono>
#include <csetjmp>
#include <cstring>
// Needs the declarations of <cstdio>.
#include <jpeglib.h>

namespace interneuron::perception {
namespace {

using Clock = std::chrono::steady_clock;

// Markers (ITU T.81, table B.1); each follows a byte 0xFF.
constexpr unsigned kStuffed = 0x00;
constexpr unsigned kBaseline = 0xC0;
constexpr unsigned kLastFrame = 0xCF;
constexpr unsigned kHuffmanTables = 0xC4;
constexpr unsigned kFirstRestart = 0xD0;
constexpr unsigned kLastRestart = 0xD7;
constexpr unsigned kStart = 0xD8;
constexpr unsigned kEnd = 0xD9;
constexpr unsigned kScan = 0xDA;
constexpr unsigned kQuantisers = 0xDB;
constexpr unsigned kLines = 0xDC;
constexpr unsigned kRestartInterval = 0xDD;
constexpr unsigned kHierarchy = 0xDE;
constexpr unsigned kExpansion = 0xDF;
constexpr unsigned kFirstApplication = 0xE0;
constexpr unsigned kLastApplication = 0xEF;
constexpr unsigned kComment = 0xFE;
// Segments beside the scans. Cameras write about ten; each costs the decoder time before its
// progress monitor is asked.
constexpr int kMaxSegments = 64;

// Walks over the markers of a file.
class Walk {
 public:
  Walk(ByteView file, const JpegLimits& limits) : file_(file), limits_(limits) {}

  JpegHead run() {
    if (file_.size() < 4 || byte(0) != 0xFF || byte(1) != kStart) head_.fault = JpegFault::kDamaged;
    at_ = 2;
    while (head_.fault == JpegFault::kNone && !ended_) head_.fault = step();
    return head_;
  }

 private:
  unsigned byte(std::size_t at) const { return std::to_integer<unsigned>(file_[at]); }
  unsigned word(std::size_t at) const { return byte(at) << 8 | byte(at + 1); }
  // Bytes from `at` to the end of the file.
  std::size_t left(std::size_t at) const { return at < file_.size() ? file_.size() - at : 0; }

  JpegFault step() {
    if (left(at_) < 2 || byte(at_) != 0xFF) return JpegFault::kDamaged;
    const unsigned marker = byte(at_ + 1);
    at_ += 2;
    if (marker == kEnd) {
      ended_ = true;
      return head_.scans > 0 && left(at_) == 0 ? JpegFault::kNone : JpegFault::kDamaged;
    }
    const bool has_length =
        marker >= kBaseline && marker != 0xFF && (marker < kFirstRestart || marker > kStart);
    if (!has_length || left(at_) < 2) return JpegFault::kDamaged;
    const std::size_t length = word(at_);
    if (length < 2 || left(at_) < length) return JpegFault::kDamaged;
    const JpegFault fault = segment(marker, length);
    if (marker != kScan) at_ += length;
    return fault;
  }

  JpegFault segment(unsigned marker, std::size_t length) {
    if (marker == kScan) return scan(length);
    if (++segments_ > kMaxSegments) return JpegFault::kDamaged;
    if (marker == kBaseline) return frame(length);
    const bool other_frame = marker <= kLastFrame && marker != kHuffmanTables;
    if (other_frame || marker == kLines || marker == kHierarchy || marker == kExpansion) {
      return JpegFault::kNotBaseline;
    }
    const bool known = marker == kHuffmanTables || marker == kQuantisers ||
                       marker == kRestartInterval || marker == kComment ||
                       (marker >= kFirstApplication && marker <= kLastApplication);
    return known ? JpegFault::kNone : JpegFault::kDamaged;
  }

  // The frame header (ITU T.81, B.2.2): length, bits, height, width, components.
  JpegFault frame(std::size_t length) {
    if (head_.size.width > 0 || length < 8) return JpegFault::kDamaged;
    const unsigned bits = byte(at_ + 2);
    head_.size = cv::Size(static_cast<int>(word(at_ + 5)), static_cast<int>(word(at_ + 3)));
    const unsigned components = byte(at_ + 7);
    if (bits != 8 || (components != 1 && components != 3)) return JpegFault::kNotBaseline;
    if (head_.size.width < 1 || head_.size.height < 1) return JpegFault::kDamaged;
    const std::int64_t pixels = std::int64_t{head_.size.width} * head_.size.height;
    return pixels > limits_.pixels ? JpegFault::kTooManyPixels : JpegFault::kNone;
  }

  // A scan and the coded bytes behind its header, up to the next marker.
  JpegFault scan(std::size_t length) {
    if (head_.size.width < 1) return JpegFault::kDamaged;
    if (++head_.scans > limits_.scans) return JpegFault::kTooManyScans;
    at_ += length;
    while (left(at_) >= 2) {
      const void* found = std::memchr(file_.data() + at_, 0xFF, left(at_) - 1);
      if (found == nullptr) return JpegFault::kDamaged;
      at_ = static_cast<std::size_t>(static_cast<const std::byte*>(found) - file_.data());
      const unsigned next = byte(at_ + 1);
      const bool coded = next == kStuffed || (next >= kFirstRestart && next <= kLastRestart);
      if (!coded) return JpegFault::kNone;
      at_ += 2;
    }
    return JpegFault::kDamaged;
  }

  ByteView file_;
  const JpegLimits& limits_;
  JpegHead head_;
  std::size_t at_ = 0;
  int segments_ = 0;
  bool ended_ = false;
};

// What the callbacks of libjpeg work on. They leave it by longjmp(), since they must not return
// after an error, so nothing between setjmp() and them may need a destructor.
struct Decoding {
  jpeg_decompress_struct info{};
  jpeg_error_mgr errors{};
  jpeg_progress_mgr progress{};
  std::jmp_buf escape{};
  Clock::time_point until{};
  JpegFault fault = JpegFault::kNone;
};

[[noreturn]] void leave(j_common_ptr info, JpegFault fault) {
  auto* decoding = static_cast<Decoding*>(info->client_data);
  decoding->fault = fault;
  std::longjmp(decoding->escape, 1);
}

void on_error(j_common_ptr info) { leave(info, JpegFault::kDamaged); }

// Levels below 0 are warnings: libjpeg would make up what it cannot decode.
void on_message(j_common_ptr info, int level) {
  if (level < 0) leave(info, JpegFault::kDamaged);
}

void on_text(j_common_ptr) {}

void on_progress(j_common_ptr info) {
  const auto* decoding = static_cast<const Decoding*>(info->client_data);
  if (Clock::now() > decoding->until) leave(info, JpegFault::kTooSlow);
}

void prepare(Decoding& decoding, Duration time) {
  decoding.until = Clock::now() + time;
  decoding.info.err = jpeg_std_error(&decoding.errors);
  decoding.errors.error_exit = on_error;
  decoding.errors.emit_message = on_message;
  decoding.errors.output_message = on_text;
  decoding.progress.progress_monitor = on_progress;
}

// Decodes into `rows`, which has the size that the file says. The struct is cleared by libjpeg but
// for its error manager and client_data.
void decode(Decoding& decoding, ByteView file, cv::Mat& rows) {
  jpeg_decompress_struct& info = decoding.info;
  info.client_data = &decoding;
  if (setjmp(decoding.escape) == 0) {
    jpeg_create_decompress(&info);
    info.progress = &decoding.progress;
    jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(file.data()), file.size());
    (void)jpeg_read_header(&info, TRUE);
    info.out_color_space = JCS_EXT_BGR;
    (void)jpeg_start_decompress(&info);
    if (info.output_width != static_cast<unsigned>(rows.cols) ||
        info.output_height != static_cast<unsigned>(rows.rows)) {
      on_error(reinterpret_cast<j_common_ptr>(&info));
    }
    while (info.output_scanline < info.output_height) {
      JSAMPROW row = rows.ptr(static_cast<int>(info.output_scanline));
      (void)jpeg_read_scanlines(&info, &row, 1);
    }
    (void)jpeg_finish_decompress(&info);
  }
  jpeg_destroy_decompress(&info);
}

}  // namespace

std::string_view to_string(JpegFault fault) {
  switch (fault) {
    case JpegFault::kNone:
      return "sound";
    case JpegFault::kNotBaseline:
      return "not baseline";
    case JpegFault::kTooManyPixels:
      return "too many pixels";
    case JpegFault::kTooManyScans:
      return "too many scans";
    case JpegFault::kDamaged:
      return "damaged";
    case JpegFault::kTooSlow:
      break;
  }
  return "too slow";
}

JpegHead inspect_jpeg(ByteView file, const JpegLimits& limits) { return Walk(file, limits).run(); }

JpegPicture decode_jpeg(ByteView file, const JpegLimits& limits) {
  const JpegHead head = inspect_jpeg(file, limits);
  if (head.fault != JpegFault::kNone) return {{}, head.fault};
  cv::Mat picture(head.size, CV_8UC3);
  Decoding decoding;
  prepare(decoding, limits.time);
  decode(decoding, file, picture);
  if (decoding.fault != JpegFault::kNone) return {{}, decoding.fault};
  return {picture, JpegFault::kNone};
}

}  // namespace interneuron::perception
