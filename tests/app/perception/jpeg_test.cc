#include "app/perception/jpeg.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <vector>
// Needs the declarations of <cstdio>.
#include <jpeglib.h>

#include "support.h"

namespace interneuron::perception::jpeg_test {
namespace {

using namespace std::chrono_literals;

// A machine that is busy with other tests must not make a sound file look slow.
constexpr JpegLimits kPatient{.time = 1min};

Bytes encoded(const cv::Mat& picture, const std::vector<int>& parameters = {}) {
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", picture, file, parameters);
  const ByteView bytes = std::as_bytes(std::span(file));
  return {bytes.begin(), bytes.end()};
}

// A sequential file with one scan for each component.
Bytes in_three_scans(const cv::Mat& bgr) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* memory = nullptr;
  unsigned long size = 0;  // as libjpeg declares it
  jpeg_mem_dest(&info, &memory, &size);
  info.image_width = static_cast<unsigned>(bgr.cols);
  info.image_height = static_cast<unsigned>(bgr.rows);
  info.input_components = 3;
  info.in_color_space = JCS_EXT_BGR;
  jpeg_set_defaults(&info);
  std::vector<jpeg_scan_info> scans(3);
  for (int i = 0; i < 3; ++i) {
    scans[static_cast<std::size_t>(i)] = {
        .comps_in_scan = 1, .component_index = {i}, .Ss = 0, .Se = 63, .Ah = 0, .Al = 0};
  }
  info.scan_info = scans.data();
  info.num_scans = 3;
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    auto* row = const_cast<JSAMPROW>(bgr.ptr(static_cast<int>(info.next_scanline)));
    (void)jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  const auto* bytes = reinterpret_cast<const std::byte*>(memory);
  Bytes file(bytes, bytes + size);
  jpeg_destroy_compress(&info);
  std::free(memory);
  return file;
}

// Where the n-th marker of this kind is, counted from 0.
std::size_t marker(const Bytes& file, unsigned kind, int n = 0) {
  for (std::size_t i = 0; i + 1 < file.size(); ++i) {
    const bool here = file[i] == std::byte{0xFF} && file[i + 1] == static_cast<std::byte>(kind);
    if (here && n-- == 0) return i;
  }
  return file.size();
}

Bytes part(const Bytes& file, std::size_t from, std::size_t to) {
  return {file.begin() + static_cast<std::ptrdiff_t>(from),
          file.begin() + static_cast<std::ptrdiff_t>(to)};
}

// The file with its last scan repeated so many times.
Bytes with_more_scans(const Bytes& file, unsigned scans_there, int more) {
  const std::size_t from = marker(file, 0xDA, static_cast<int>(scans_there) - 1);
  const Bytes scan = part(file, from, file.size() - 2);
  Bytes out = part(file, 0, file.size() - 2);
  for (int i = 0; i < more; ++i) out.insert(out.end(), scan.begin(), scan.end());
  out.insert(out.end(), file.end() - 2, file.end());
  return out;
}

TEST(Jpeg, DecodesAsOpenCvDoes) {
  for (const cv::Size size : {cv::Size(768, 576), cv::Size(1, 1), cv::Size(17, 999)}) {
    cv::Mat picture;
    cv::resize(scene(), picture, size);
    const Bytes file = encoded(picture);
    const JpegPicture decoded = decode_jpeg(file, kPatient);
    ASSERT_EQ(decoded.fault, JpegFault::kNone);
    const cv::Mat bytes(1, static_cast<int>(file.size()), CV_8UC1,
                        const_cast<std::byte*>(file.data()));
    const cv::Mat expected = cv::imdecode(bytes, cv::IMREAD_COLOR);
    ASSERT_EQ(decoded.bgr.size(), size);
    EXPECT_EQ(cv::norm(decoded.bgr, expected, cv::NORM_INF), 0) << size;
  }
}

TEST(Jpeg, DecodesGrey) {
  cv::Mat grey;
  cv::cvtColor(scene(), grey, cv::COLOR_BGR2GRAY);
  const JpegPicture decoded = decode_jpeg(encoded(grey), kPatient);
  ASSERT_EQ(decoded.fault, JpegFault::kNone);
  EXPECT_EQ(decoded.bgr.type(), CV_8UC3);
}

TEST(Jpeg, DecodesAScanForEachComponent) {
  const Bytes file = in_three_scans(scene());
  const JpegHead head = inspect_jpeg(file);
  EXPECT_EQ(head.fault, JpegFault::kNone);
  EXPECT_EQ(head.scans, 3);
  EXPECT_EQ(head.size, scene().size());
  const JpegPicture decoded = decode_jpeg(file, kPatient);
  ASSERT_EQ(decoded.fault, JpegFault::kNone);
  EXPECT_LT(cv::norm(decoded.bgr, scene(), cv::NORM_L1) / static_cast<double>(3 * scene().total()),
            5.0);
}

TEST(Jpeg, RefusesManyScansBeforeItDecodes) {
  const Bytes file = in_three_scans(scene());
  EXPECT_EQ(inspect_jpeg(with_more_scans(file, 3, 1)).fault, JpegFault::kNone);
  EXPECT_EQ(decode_jpeg(with_more_scans(file, 3, 2)).fault, JpegFault::kTooManyScans);
  EXPECT_EQ(decode_jpeg(with_more_scans(file, 3, 300)).fault, JpegFault::kTooManyScans);
}

TEST(Jpeg, RefusesProgressive) {
  const Bytes file = encoded(scene(), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  EXPECT_EQ(decode_jpeg(file).fault, JpegFault::kNotBaseline);
}

TEST(Jpeg, RefusesEveryFrameButBaseline) {
  const Bytes good = encoded(scene());
  const std::size_t at = marker(good, 0xC0);
  for (const unsigned kind : {0xC1U, 0xC2U, 0xC3U, 0xC5U, 0xC6U, 0xC7U, 0xC8U, 0xC9U, 0xCAU, 0xCBU,
                              0xCCU, 0xCDU, 0xCEU, 0xCFU, 0xDCU, 0xDEU, 0xDFU}) {
    Bytes other = good;
    other[at + 1] = static_cast<std::byte>(kind);
    EXPECT_EQ(decode_jpeg(other).fault, JpegFault::kNotBaseline) << std::hex << kind;
  }
  Bytes bits = good;
  bits[at + 4] = std::byte{12};
  EXPECT_EQ(decode_jpeg(bits).fault, JpegFault::kNotBaseline);
  Bytes components = good;
  components[at + 9] = std::byte{4};
  EXPECT_EQ(decode_jpeg(components).fault, JpegFault::kNotBaseline);
}

TEST(Jpeg, RefusesMorePixelsThanAllowed) {
  const Bytes file = encoded(scene());
  const int pixels = scene().cols * scene().rows;
  EXPECT_EQ(decode_jpeg(file, {.pixels = pixels, .time = 1min}).fault, JpegFault::kNone);
  EXPECT_EQ(decode_jpeg(file, {.pixels = pixels - 1}).fault, JpegFault::kTooManyPixels);
  Bytes huge = file;
  const std::size_t at = marker(huge, 0xC0);
  for (std::size_t i = 5; i < 9; ++i) huge[at + i] = std::byte{0xFF};
  EXPECT_EQ(decode_jpeg(huge).fault, JpegFault::kTooManyPixels);
}

TEST(Jpeg, GivesUpWhenTheTimeIsOver) {
  EXPECT_EQ(decode_jpeg(encoded(scene()), {.time = -1ns}).fault, JpegFault::kTooSlow);
  EXPECT_EQ(decode_jpeg(in_three_scans(scene()), {.time = -1ns}).fault, JpegFault::kTooSlow);
}

TEST(Jpeg, RefusesWhatIsCutOffOrLonger) {
  Bytes file = encoded(scene());
  for (std::size_t size = 0; size < file.size(); size += 97) {
    ASSERT_EQ(decode_jpeg(ByteView(file).first(size)).fault, JpegFault::kDamaged) << size;
  }
  // Coded bytes are missing, the end is there.
  Bytes hole = part(file, 0, file.size() / 2);
  hole.insert(hole.end(), file.end() - 2, file.end());
  EXPECT_EQ(decode_jpeg(hole, kPatient).fault, JpegFault::kDamaged);
  file.push_back(std::byte{0});
  EXPECT_EQ(decode_jpeg(file).fault, JpegFault::kDamaged);
}

TEST(Jpeg, RefusesThousandsOfTables) {
  const Bytes file = encoded(scene());
  const std::size_t at = marker(file, 0xDB);
  const Bytes comment = {std::byte{0xFF}, std::byte{0xFE}, std::byte{0}, std::byte{2}};
  Bytes few = file;
  Bytes many = file;
  for (int i = 0; i < 100; ++i) {
    Bytes& out = i < 20 ? few : many;
    out.insert(out.begin() + static_cast<std::ptrdiff_t>(at), comment.begin(), comment.end());
  }
  EXPECT_EQ(decode_jpeg(few, kPatient).fault, JpegFault::kNone);
  EXPECT_EQ(decode_jpeg(many).fault, JpegFault::kDamaged);
}

TEST(Jpeg, NamesItsFaults) {
  EXPECT_EQ(to_string(JpegFault::kTooSlow), "too slow");
  EXPECT_EQ(to_string(JpegFault::kNotBaseline), "not baseline");
}

RC_GTEST_PROP(Jpeg, AnyChangeIsSafe, ()) {
  static const Bytes kGood = in_three_scans(scene()(cv::Rect(0, 0, 160, 120)).clone());
  Bytes bytes = kGood;
  const auto changes = *rc::gen::inRange(1, 6);
  for (int i = 0; i < changes; ++i) {
    bytes[*rc::gen::inRange<std::size_t>(0, bytes.size())] =
        static_cast<std::byte>(*rc::gen::arbitrary<std::uint8_t>());
  }
  const JpegPicture decoded = decode_jpeg(bytes);
  RC_ASSERT(decoded.bgr.empty() == (decoded.fault != JpegFault::kNone));
  RC_ASSERT(decoded.bgr.total() <= static_cast<std::size_t>(kMaxJpegPixels));
}

}  // namespace
}  // namespace interneuron::perception::jpeg_test
