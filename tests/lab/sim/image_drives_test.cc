#include "lab/coding/image_drives.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace interneuron::coding::image_drives_test {
namespace {

constexpr std::size_t kRounds = 100;

const ImageRow& of(const ImageDriveRow& row, const std::string& images) {
  return *std::ranges::find(row.rows, images, &ImageRow::images);
}

// Modems of 20.7 and 7.4 Mbit/s up.
TEST(ImageDrives, JpegsBringMoreThanBitmaps) {
  const ImageDriveRow row = run_image_drive(generated_drive(2), kRounds, 2);
  ASSERT_EQ(row.mbit.size(), 2U);
  const ImageRow& paper = of(row, "paper");
  const ImageRow& jpeg = of(row, "jpeg");
  EXPECT_GT(jpeg.ours.on_time, paper.ours.on_time);
  EXPECT_GT(jpeg.ours.quality, paper.ours.quality + 0.02);
  EXPECT_LT(jpeg.bytes, paper.bytes);
  EXPECT_GE(jpeg.ours.on_time + 2, jpeg.clairvoyant.on_time);
}

TEST(ImageDrives, NobodyBeatsTheClairvoyant) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const ImageDriveRow row = run_image_drive(generated_drive(seed), kRounds, seed);
    for (const ImageRow& way : row.rows) {
      EXPECT_LE(way.ours.on_time, way.clairvoyant.on_time) << way.images << " " << seed;
      EXPECT_LE(way.ours.quality, way.clairvoyant.quality) << way.images << " " << seed;
      EXPECT_EQ(std::accumulate(way.by_variant.begin(), way.by_variant.end(), std::size_t{0}),
                way.ours.on_time);
    }
  }
}

TEST(ImageDrives, TheSameSeedGivesTheSameRow) {
  const ImageDriveRow a = run_image_drive(generated_drive(4), 30, 4);
  const ImageDriveRow b = run_image_drive(generated_drive(4), 30, 4);
  ASSERT_EQ(a.rows.size(), b.rows.size());
  for (std::size_t i = 0; i < a.rows.size(); ++i) {
    EXPECT_EQ(a.rows[i].ours.quality, b.rows[i].ours.quality);
    EXPECT_EQ(a.rows[i].by_variant, b.rows[i].by_variant);
  }
}

}  // namespace
}  // namespace interneuron::coding::image_drives_test
