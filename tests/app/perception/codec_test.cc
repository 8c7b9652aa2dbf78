#include "app/perception/codec.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <array>

#include "support.h"

namespace interneuron::perception::codec_test {
namespace {

// The scene, as frame 5.
Bytes encoded(Variant variant) { return encode_image(make_variant(scene(), 5, variant)); }

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

TEST(Codec, VariantsHaveThePapersSizes) {
  EXPECT_EQ(encoded_size(Variant::kRaw), 524'172U + 16);
  EXPECT_EQ(encoded_size(Variant::kSampled), 131'406U + 16);
  const auto variants = encode_variants(scene(), 7);
  ASSERT_EQ(variants.size(), 2U);
  EXPECT_EQ(variants[0].size(), encoded_size(Variant::kRaw));
  EXPECT_EQ(variants[1].size(), encoded_size(Variant::kSampled));
}

TEST(Codec, DecodesWhatItEncodes) {
  const cv::Mat bgr = scene();
  const auto variants = encode_variants(bgr, 4'000'000'000U);
  for (const Variant variant : {Variant::kRaw, Variant::kSampled}) {
    const auto image = decode_image(variants[static_cast<std::size_t>(variant)]);
    ASSERT_TRUE(image);
    EXPECT_EQ(image->variant, variant);
    EXPECT_EQ(image->frame, 4'000'000'000U);
    EXPECT_EQ(image->source, cv::Size(768, 576));
    EXPECT_TRUE(same(image->bgr, make_variant(bgr, 0, variant).bgr));
  }
}

TEST(Codec, SampledIsEverySecondPixelOfRaw) {
  const cv::Mat raw = make_variant(scene(), 0, Variant::kRaw).bgr;
  const cv::Mat sampled = make_variant(scene(), 0, Variant::kSampled).bgr;
  ASSERT_EQ(sampled.size(), cv::Size(kSampledWidth, kSampledHeight));
  for (int y = 0; y < sampled.rows; ++y) {
    for (int x = 0; x < sampled.cols; ++x) {
      ASSERT_EQ(sampled.at<cv::Vec3b>(y, x), raw.at<cv::Vec3b>(2 * y, 2 * x)) << x << "," << y;
    }
  }
}

TEST(Codec, RawKeepsColoursInPlace) {
  cv::Mat bgr(576, 768, CV_8UC3, cv::Scalar(10, 20, 30));
  bgr(cv::Rect(0, 0, 384, 576)).setTo(cv::Scalar(200, 100, 50));
  const auto bytes = encode_variants(bgr, 0)[0];
  EXPECT_EQ(std::to_integer<int>(bytes[16]), 200);
  EXPECT_EQ(std::to_integer<int>(bytes[17]), 100);
  EXPECT_EQ(std::to_integer<int>(bytes[18]), 50);
  EXPECT_EQ(std::to_integer<int>(bytes.back()), 30);
}

TEST(Codec, TakesSourcesOfAnyShape) {
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(1920, 1080), cv::Size(3, 2000), cv::Size(484, 361)}) {
    for (const Bytes& bytes : encode_variants(cv::Mat(size, CV_8UC3, cv::Scalar::all(9)), 1)) {
      const auto image = decode_image(bytes);
      ASSERT_TRUE(image);
      EXPECT_EQ(image->source, size);
    }
  }
}

TEST(Codec, TakesPartOfALargerPicture) {
  const cv::Mat part = scene()(cv::Rect(100, 100, 484, 361));  // rows are not contiguous
  const auto image = decode_image(encode_variants(part, 1)[0]);
  ASSERT_TRUE(image);
  EXPECT_TRUE(same(image->bgr, part));
}

TEST(Codec, RejectsEveryTruncation) {
  for (const Variant variant : {Variant::kRaw, Variant::kGrey, Variant::kJpegHalf}) {
    const Bytes bytes = encoded(variant);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      ASSERT_FALSE(decode_image(ByteView(bytes).first(size))) << size;
    }
  }
}

TEST(Codec, RejectsAByteTooMany) {
  for (Bytes bytes : encode_variants(scene(), 3)) {
    bytes.push_back(std::byte{0});
    EXPECT_FALSE(decode_image(bytes));
  }
}

TEST(Codec, RejectsHeadersThatLie) {
  const Bytes good = encode_variants(scene(), 3)[1];
  // Magic, version, variant, width, height: no other value is right. Source sides must not be 0.
  for (std::size_t at = 0; at < 8; ++at) {
    Bytes bad = good;
    bad[at] ^= std::byte{1};
    EXPECT_FALSE(decode_image(bad)) << at;
  }
  for (const std::size_t at : {12U, 14U}) {
    Bytes bad = good;
    bad[at] = bad[at + 1] = std::byte{0};
    EXPECT_FALSE(decode_image(bad)) << at;
  }
}

TEST(Codec, TellsFromTheHeaderWhatMayBeAnImage) {
  const std::array variants{encoded(Variant::kRaw), encoded(Variant::kJpeg)};
  for (const Bytes& good : variants) {
    EXPECT_TRUE(may_be_image(good));
    EXPECT_FALSE(may_be_image(ByteView(good).first(kImageHeaderBytes - 1)));
  }
  EXPECT_FALSE(may_be_image(ByteView(variants[0]).first(variants[0].size() - 1)));
  EXPECT_TRUE(may_be_image(ByteView(variants[1]).first(variants[1].size() - 1)))
      << "only decoding tells";
  Bytes long_one = variants[1];
  long_one.resize(kMaxJpegBytes + 1);
  EXPECT_FALSE(may_be_image(long_one));
}

// --- grey and JPEG

TEST(Codec, GreyIsRawWithoutColours) {
  const Bytes bytes = encoded(Variant::kGrey);
  EXPECT_EQ(bytes.size(), encoded_size(Variant::kGrey));
  EXPECT_EQ(bytes.size(), 174'724U + 16);  // a third of raw
  const auto image = decode_image(bytes);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->variant, Variant::kGrey);
  EXPECT_TRUE(same(image->bgr, make_variant(scene(), 5, Variant::kGrey).bgr));
  cv::Mat expected;
  cv::cvtColor(make_variant(scene(), 5, Variant::kRaw).bgr, expected, cv::COLOR_BGR2GRAY);
  cv::cvtColor(expected, expected, cv::COLOR_GRAY2BGR);
  EXPECT_TRUE(same(image->bgr, expected));
}

TEST(Codec, JpegHoldsTheWholeFrameInFewBytes) {
  const Bytes bytes = encoded(Variant::kJpeg);
  EXPECT_LT(bytes.size(), encoded_size(Variant::kSampled));
  const auto image = decode_image(bytes);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->variant, Variant::kJpeg);
  EXPECT_EQ(image->frame, 5U);
  ASSERT_EQ(image->bgr.size(), scene().size());
  EXPECT_LT(cv::norm(image->bgr, scene(), cv::NORM_L1) / static_cast<double>(3 * scene().total()),
            5.0);  // of 255
}

TEST(Codec, JpegOfAHugeFrameIsMadeSmaller) {
  const cv::Mat huge(4000, 5000, CV_8UC3, cv::Scalar::all(7));
  const auto image = decode_image(encode_image(make_variant(huge, 0, Variant::kJpeg)));
  ASSERT_TRUE(image);
  EXPECT_LE(image->bgr.total(), static_cast<std::size_t>(kMaxJpegPixels));
  EXPECT_EQ(image->source, huge.size());
}

TEST(Codec, RejectsAJpegThatIsNotOfTheSizeItClaims) {
  const Bytes good = encoded(Variant::kJpeg);
  // Magic, version, width, height.
  for (const std::size_t at : {0U, 1U, 2U, 4U, 5U, 6U, 7U}) {
    Bytes bad = good;
    bad[at] ^= std::byte{1};
    EXPECT_FALSE(decode_image(bad)) << at;
  }
}

// --- ladders of images

TEST(Images, NamesAreThoseOfTheOptionAndOfFiles) {
  EXPECT_EQ(parse_images("paper"), Images::kPaper);
  EXPECT_EQ(parse_images("jpeg"), Images::kJpeg);
  EXPECT_EQ(parse_images("JPEG"), std::nullopt);
  for (std::size_t i = 0; i < kVariants; ++i) {
    const auto variant = static_cast<Variant>(i);
    EXPECT_EQ(parse_variant(to_string(variant)), variant);
  }
  EXPECT_EQ(parse_variant("png"), std::nullopt);
}

TEST(Images, AVariantTellsItsLadder) {
  for (const Images images : {Images::kPaper, Images::kJpeg}) {
    for (const Variant variant : variants_of(images)) {
      EXPECT_EQ(images_of(variant), images);
      const Bytes bytes = encoded(variant);
      EXPECT_EQ(claimed_variant(bytes), variant);
      const auto image = decode_image(bytes);
      ASSERT_TRUE(image) << to_string(variant);
      EXPECT_EQ(image->variant, variant);
      EXPECT_EQ(image->source, scene().size());
    }
  }
  EXPECT_EQ(claimed_variant(Bytes(100)), std::nullopt);
}

TEST(Images, EachRungIsSmallerThanTheOneBefore) {
  for (const Images images : {Images::kPaper, Images::kJpeg}) {
    const auto variants = encode_variants(scene(), 1, variants_of(images));
    for (std::size_t i = 1; i < variants.size(); ++i) {
      EXPECT_LT(variants[i].size(), variants[i - 1].size()) << i;
    }
  }
}

TEST(Images, AJpegHasTheSizeOfItsForm) {
  for (const Variant variant : variants_of(Images::kJpeg)) {
    const cv::Mat bgr = make_variant(scene(), 5, variant).bgr;
    EXPECT_EQ(bgr.cols, scene().cols / jpeg_form(variant).divisor) << to_string(variant);
    EXPECT_EQ(bgr.rows, scene().rows / jpeg_form(variant).divisor) << to_string(variant);
  }
}

TEST(Images, AnotherFormThanTheLadders) {
  const Bytes fine = encode_jpeg(scene(), 9, {.divisor = 3, .quality = 90});
  const Bytes coarse = encode_jpeg(scene(), 9, {.divisor = 3, .quality = 20});
  EXPECT_LT(coarse.size(), fine.size());
  const auto image = decode_image(coarse);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->frame, 9U);
  EXPECT_EQ(image->bgr.size(), cv::Size(256, 192));
}

RC_GTEST_PROP(Codec, JpegNeverThrowsOnAnyBytes, ()) {
  static const Bytes kGood = encoded(Variant::kJpeg);
  Bytes bytes = kGood;
  const auto flips = *rc::gen::inRange(1, 5);
  for (int i = 0; i < flips; ++i) {
    bytes[*rc::gen::inRange<std::size_t>(0, 700)] =
        static_cast<std::byte>(*rc::gen::arbitrary<std::uint8_t>());
  }
  if (const auto image = decode_image(bytes)) {
    RC_ASSERT(image->bgr.total() <= static_cast<std::size_t>(kMaxJpegPixels));
  }
}

RC_GTEST_PROP(Codec, NeverThrowsOnAnyBytes, (std::vector<std::uint8_t> text)) {
  (void)decode_image(std::as_bytes(std::span(text)));
}

RC_GTEST_PROP(Codec, HeaderBitFlipsDecodeToTheSameBytesOrNothing, ()) {
  static const Bytes kGood = encode_variants(scene(), 3)[1];
  Bytes bytes = kGood;
  const auto at = *rc::gen::inRange<std::size_t>(0, kImageHeaderBytes);
  bytes[at] = static_cast<std::byte>(*rc::gen::arbitrary<std::uint8_t>());
  if (const auto image = decode_image(bytes)) RC_ASSERT(encode_image(*image) == bytes);
}

}  // namespace
}  // namespace interneuron::perception::codec_test
