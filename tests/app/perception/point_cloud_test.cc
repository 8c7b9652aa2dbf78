#include "app/perception/point_cloud.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "support.h"

namespace interneuron::perception::point_cloud_test {
namespace {

using testing::HasSubstr;

// Clustered, so that voxels hold several; on boundaries, too.
Points any_points() {
  const auto count = *rc::gen::inRange(0, 300);
  const float spread = *rc::gen::element(1.0F, 30.0F, kMaxCoordinate);
  Points points(4, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (int axis = 0; axis < 4; ++axis) {
      points(axis, i) = spread * static_cast<float>(*rc::gen::inRange(-64, 65)) / 64;
    }
  }
  return points;
}

double any_side() { return *rc::gen::element(kMinVoxel, 0.2, 0.4, 1.0, 7.0, kMaxVoxel); }

using Voxel = std::array<int, 3>;
Voxel voxel_of(const Points& points, Eigen::Index i, double side) {
  Voxel voxel{};
  for (int axis = 0; axis < 3; ++axis) {
    voxel[static_cast<std::size_t>(axis)] =
        static_cast<int>(std::floor(points(axis, i) / static_cast<float>(side)));
  }
  return voxel;
}

RC_GTEST_PROP(VoxelGrid, KeepsTheCentroidOfEveryVoxelInsideIt, ()) {
  const Points points = any_points();
  const double side = any_side();
  std::map<Voxel, std::pair<Eigen::Vector4d, int>> expected;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    auto& [sum, count] =
        expected.try_emplace(voxel_of(points, i, side), Eigen::Vector4d::Zero(), 0).first->second;
    sum += points.col(i).cast<double>();
    ++count;
  }
  const Points kept = voxel_grid(points, side);
  RC_ASSERT(static_cast<std::size_t>(kept.cols()) == expected.size());
  for (Eigen::Index i = 0; i < kept.cols(); ++i) {
    const auto at = expected.find(voxel_of(kept, i, side));
    RC_ASSERT(at != expected.end());
    const Eigen::Vector4f mean = (at->second.first / at->second.second).cast<float>();
    RC_ASSERT((mean - kept.col(i)).norm() <= 1e-6F * (1 + mean.norm()));
    expected.erase(at);  // one point per voxel
  }
}

RC_GTEST_PROP(VoxelGrid, TheCountNeverGrowsAndThinningAgainChangesNoCount, ()) {
  const Points points = any_points();
  const double side = any_side();
  const Points once = voxel_grid(points, side);
  RC_ASSERT(once.cols() <= points.cols());
  RC_ASSERT((once.cols() == 0) == (points.cols() == 0));
  RC_ASSERT(voxel_grid(once, side).cols() == once.cols());
}

RC_GTEST_PROP(Stride, IsExactlyEveryNth, ()) {
  const Points points = any_points();
  const int n = *rc::gen::inRange(1, 400);
  const Points kept = stride(points, n);
  RC_ASSERT(kept.cols() == (points.cols() + n - 1) / n);
  for (Eigen::Index i = 0; i < kept.cols(); ++i) RC_ASSERT(kept.col(i) == points.col(i * n));
}

RC_GTEST_PROP(CloudCodec, DecodesWhatItEncodes, ()) {
  const Cloud cloud{any_points(), *rc::gen::element(CloudVariant::kRaw, CloudVariant::kStride),
                    *rc::gen::arbitrary<std::uint32_t>()};
  const Bytes bytes = encode_cloud(cloud);
  RC_ASSERT(bytes.size() ==
            kCloudHeaderBytes + kPointBytes * static_cast<std::size_t>(cloud.points.cols()));
  const auto decoded = decode_cloud(bytes);
  RC_ASSERT(decoded.has_value());
  RC_ASSERT(decoded->points == cloud.points);
  RC_ASSERT(decoded->variant == cloud.variant && decoded->frame == cloud.frame);
}

RC_GTEST_PROP(CloudCodec, NeverThrowsOnAnyBytes, (std::vector<std::uint8_t> text)) {
  (void)decode_cloud(std::as_bytes(std::span(text)));
}

TEST(CloudCodec, RejectsWhatIsNotExactlyOneCloud) {
  const Points points = Points::Constant(4, 3, 1.5F);
  const Bytes good = encode_cloud({points, CloudVariant::kVoxels, 3});
  for (std::size_t size = 0; size < good.size(); ++size) {
    ASSERT_FALSE(decode_cloud(ByteView(good).first(size))) << size;
  }
  Bytes longer = good;
  longer.push_back(std::byte{});
  EXPECT_FALSE(decode_cloud(longer));
  for (const std::size_t at : {0U, 1U, 2U, 8U, 11U}) {
    Bytes bad = good;
    bad[at] ^= std::byte{1};
    EXPECT_FALSE(decode_cloud(bad)) << at;
  }
  Bytes bad = good;
  bad[3] = std::byte{3};
  EXPECT_FALSE(decode_cloud(bad));
  Points far = points;
  for (const float value : {2 * kMaxCoordinate, std::numeric_limits<float>::quiet_NaN(),
                            std::numeric_limits<float>::infinity()}) {
    far(1, 2) = value;
    EXPECT_FALSE(decode_cloud(encode_cloud({far, CloudVariant::kRaw, 0})));
  }
}

TEST(CloudCodec, TheLadderIsTheWholeSweepThenCoarserVoxels) {
  Points points = Points::Zero(4, 4);
  points.row(0) << 0.01F, 0.15F, 0.25F, 5;
  const auto variants = encode_cloud_ladder(points, 9);
  ASSERT_EQ(variants.size(), cloud_rungs().size());
  std::vector<Eigen::Index> counts;
  for (const Bytes& variant : variants) {
    const auto cloud = decode_cloud(variant);
    ASSERT_TRUE(cloud);
    EXPECT_EQ(cloud->frame, 9U);
    counts.push_back(cloud->points.cols());
  }
  EXPECT_EQ(counts, (std::vector<Eigen::Index>{4, 4, 3, 2}));
  EXPECT_EQ(decode_cloud(variants.front())->variant, CloudVariant::kRaw);
  EXPECT_EQ(decode_cloud(variants.back())->variant, CloudVariant::kVoxels);
}

// --- files

std::string floats(const std::vector<float>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

TEST(ReadCloud, TakesKittiAndNuScenesByName) {
  const TempDir dir;
  const std::vector<float> twenty{0,  1,  2,  3,  4,  5,  6,  7,  8,  9,
                                  10, 11, 12, 13, 14, 15, 16, 17, 18, 19};
  write_text(dir / "a.bin", floats(twenty));
  write_text(dir / "a.pcd.bin", floats(twenty));
  EXPECT_EQ(read_cloud(dir / "a.bin").cols(), 5);
  const Points points = read_cloud(dir / "a.pcd.bin");
  ASSERT_EQ(points.cols(), 4);
  EXPECT_TRUE(points.col(1) == Eigen::Vector4f(5, 6, 7, 8));
}

TEST(ReadCloud, SaysWhatIsWrongAndWhatToGive) {
  const TempDir dir;
  write_text(dir / "empty.bin", "");
  write_text(dir / "odd.bin", floats({1, 2, 3, 4, 5}));
  write_text(dir / "odd.pcd.bin", floats({1, 2, 3, 4}));
  write_text(dir / "nan.bin", floats({1, 2, 3, 4, 1, std::nanf(""), 3, 4}));
  write_text(dir / "far.bin", floats({1, 2, 1e6F, 4}));
  for (const char* name :
       {"missing.bin", "empty.bin", "odd.bin", "odd.pcd.bin", "nan.bin", "far.bin", "."}) {
    const std::string what = complaint([&] { (void)read_cloud(dir / name); });
    EXPECT_THAT(what, HasSubstr((dir / name).string()));
    EXPECT_THAT(what, HasSubstr("give a KITTI .bin or nuScenes .pcd.bin")) << name;
    EXPECT_EQ(what.find('\n'), std::string::npos);
  }
  EXPECT_THAT(complaint([&] { (void)read_cloud(dir / "nan.bin"); }), HasSubstr("point 1 "));
}

TEST(ReadCloud, ThinsRealSweeps) {
  if (skips_without({"pointcloud/kitti_000008.bin"})) return;
  const auto folder = *data_dir() / "pointcloud";
  const Points kitti = read_cloud(folder / "kitti_000008.bin");
  EXPECT_EQ(kitti.cols(), 17'238);
  EXPECT_EQ(voxel_grid(kitti, 0.2).cols(), 5'610);
  EXPECT_EQ(voxel_grid(kitti, 0.4).cols(), 2'651);
  const Points nuscenes = read_cloud(folder / "nuscenes_lidar_top.pcd.bin");
  EXPECT_EQ(nuscenes.cols(), 34'688);
  EXPECT_EQ(voxel_grid(nuscenes, 0.2).cols(), 12'641);
  EXPECT_EQ(voxel_grid(nuscenes, 0.4).cols(), 7'879);
}

}  // namespace
}  // namespace interneuron::perception::point_cloud_test
