#include "lab/eval/quality.h"

#include <gtest/gtest.h>

namespace interneuron::eval::quality_test {
namespace {

TEST(Profile, IsTheLadderOnRawAndSampledAsMeasured) {
  const Profile p = default_profile();
  ASSERT_EQ(p.levels.size(), 3U);
  ASSERT_EQ(p.variants.size(), 2U);
  EXPECT_EQ(p.variants[0].bytes, 524'204U);
  EXPECT_EQ(p.variants[1].bytes, 131'438U);
  EXPECT_DOUBLE_EQ(remote_quality(p, 2, 0), 0.396);
  EXPECT_DOUBLE_EQ(remote_quality(p, 2, 1), 0.383);
  EXPECT_DOUBLE_EQ(p.fallback.local, 0.136);
}

TEST(Profile, WithJpegTheBestVariantIsSmallerAndHardlyWorse) {
  const Profile p = default_profile(true);
  EXPECT_EQ(p.variants[0].name, "jpeg");
  EXPECT_LT(p.variants[0].bytes, p.variants[1].bytes);
  EXPECT_DOUBLE_EQ(remote_quality(p, 2, 0), 0.391);
  EXPECT_GT(remote_quality(p, 2, 0), remote_quality(p, 2, 1));
}

TEST(Quality, AgeCostsWhatWasMeasured) {
  const Profile p = default_profile();
  Shown shown{Shown::Kind::kStale, 2, 0, 1};
  EXPECT_DOUBLE_EQ(quality_of(p, shown), 0.250);
  EXPECT_GT(quality_of(p, shown), quality_of(p, {Shown::Kind::kLocal, 0, 0, 0}));
  shown.age = 2;
  EXPECT_DOUBLE_EQ(quality_of(p, shown), 0.109);
  EXPECT_LT(quality_of(p, shown), quality_of(p, {Shown::Kind::kLocal, 0, 0, 0}));
  shown.age = 4;
  EXPECT_EQ(quality_of(p, shown), 0);
  EXPECT_EQ(quality_of(p, {}), 0);
}

}  // namespace
}  // namespace interneuron::eval::quality_test
