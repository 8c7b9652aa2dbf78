#include "app/perception/clusters.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "support.h"

namespace interneuron::perception::clusters_test {
namespace {

constexpr float kSpacing = 0.1F;       // m between the points of a surface
constexpr float kSensorHeight = 1.7F;  // m

// The four sides of an upright body on the ground.
struct Body {
  Eigen::Vector2f centre;
  Eigen::Vector2f size;
  float degrees = 0;
};

Points scene(const std::vector<Body>& bodies) {
  std::vector<Eigen::Vector3f> points;
  for (float x = -30; x < 30; x += 2 * kSpacing) {
    for (float y = -30; y < 30; y += 2 * kSpacing) points.emplace_back(x, y, -kSensorHeight);
  }
  for (const Body& b : bodies) {
    const Eigen::Rotation2Df turn(b.degrees * std::numbers::pi_v<float> / 180);
    const auto add = [&](float u, float v) {
      const Eigen::Vector2f at = b.centre + turn * Eigen::Vector2f(u, v);
      for (float z = 0; z < 1.5F; z += kSpacing) {
        points.emplace_back(at.x(), at.y(), z - kSensorHeight);
      }
    };
    const Eigen::Vector2f half = b.size / 2;
    for (float u = -half.x(); u <= half.x(); u += kSpacing) add(u, -half.y()), add(u, half.y());
    for (float v = -half.y(); v <= half.y(); v += kSpacing) add(-half.x(), v), add(half.x(), v);
  }
  Points out(4, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    out.col(static_cast<Eigen::Index>(i)) << points[i], 0.5F;
  }
  return out;
}

const Body kCar{{10, 5}, {4.5F, 1.8F}, 30};
const Body kVan{{-8, -6}, {5, 2}, 70};
const Body kWall{{0, 20}, {40, 0.3F}, 0};

TEST(Clusters, EveryLevelFindsTheBodiesAndNoWallAndNoGround) {
  const Points points = scene({kCar, kVan, kWall});
  for (const ClusterLevel& level : cluster_levels()) {
    const std::vector<Cluster> found = find_clusters(points, level);
    ASSERT_EQ(found.size(), 2U) << level.name;
    EXPECT_NEAR(found[0].area.center.x, 10, 0.3) << level.name;
    EXPECT_NEAR(found[0].area.center.y, 5, 0.3) << level.name;
    EXPECT_NEAR(found[0].area.size.area(), 4.5 * 1.8, 2) << level.name;
    EXPECT_NEAR(found[1].area.center.x, -8, 0.3) << level.name;
    EXPECT_NEAR(found[0].high, 1.4 - kSensorHeight, 0.3) << level.name;
  }
}

TEST(Clusters, BoxesAreTurnedAsTheBodiesAre) {
  const auto found = find_clusters(scene({kCar, kVan}), cluster_levels().back());
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[0].area.angle, 30, 1.5);
  EXPECT_NEAR(found[0].area.size.width, 4.5, 0.15);
  EXPECT_NEAR(found[0].area.size.height, 1.8, 0.15);
  EXPECT_NEAR(found[1].area.angle, 70, 1.5);
}

TEST(Clusters, FewOrNoPointsAreNoObject) {
  for (const ClusterLevel& level : cluster_levels()) {
    for (const Eigen::Index count : {0, 1, 2, 3, 50}) {
      EXPECT_TRUE(find_clusters(Points::Constant(4, count, 3), level).empty()) << count;
    }
  }
}

RC_GTEST_PROP(Clusters, AnyValidPointsWillDo, ()) {
  const auto count = *rc::gen::inRange(0, 200);
  const float spread = *rc::gen::element(0.0F, 3.0F, kMaxCoordinate);
  Points points(4, count);
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    points(i) = spread * static_cast<float>(*rc::gen::inRange(-64, 65)) / 64;
  }
  for (const ClusterLevel& level : cluster_levels()) {
    for (const Cluster& c : find_clusters(points, level)) {
      RC_ASSERT(c.low <= c.high);
      RC_ASSERT(std::isfinite(c.area.center.x) && c.area.size.width >= 0);
    }
  }
}

Cluster square_at(float x, float y) { return {{{x, y}, {2, 2}, 0}, 0, 1}; }

TEST(Agreement, IsOneWithItselfAndZeroWithNothing) {
  const std::vector<Cluster> some{square_at(0, 0), square_at(5, 5), square_at(-9, 1)};
  EXPECT_DOUBLE_EQ(agreement(some, some), 1);
  EXPECT_DOUBLE_EQ(agreement({}, {}), 1);
  EXPECT_DOUBLE_EQ(agreement(some, {}), 0);
  EXPECT_DOUBLE_EQ(agreement({}, some), 0);
}

TEST(Agreement, CountsWhatIsMissedAndWhatIsMadeUp) {
  const std::vector<Cluster> reference{square_at(0, 0), square_at(5, 5)};
  const std::vector<Cluster> one{square_at(0, 0)};
  const std::vector<Cluster> three{square_at(0, 0), square_at(5, 5), square_at(20, 0)};
  EXPECT_NEAR(agreement(one, reference), 2.0 / 3, 1e-9);
  EXPECT_NEAR(agreement(three, reference), 4.0 / 5, 1e-9);
}

// Moved by 0.4 of 2 m: intersection 1.6 of a union of 2.4, .667, which reaches .50, .55, .60 and
// .65.
TEST(Agreement, IsTheMeanOverThresholds) {
  const std::vector<Cluster> reference{square_at(0, 0)};
  const std::vector<Cluster> moved{square_at(0.4F, 0)};
  EXPECT_NEAR(agreement(moved, reference), 0.4, 1e-9);
}

TEST(MovedSweeps, TheSameNumberIsTheSameSweepAndALapComesBack) {
  const Points still = scene({kCar});
  const MovedSweeps a(still, 7);
  const MovedSweeps b(still, 7);
  EXPECT_EQ(a.sweep(3), b.sweep(3));
  EXPECT_EQ(a.sweep(3), a.sweep(3 + kLapSweeps));
  EXPECT_NE(a.sweep(3), a.sweep(4));
  EXPECT_NE(a.sweep(3), MovedSweeps(still, 8).sweep(3));
}

// The distance of the sensor's places, seen as that of a far body whose direction is turned back.
TEST(MovedSweeps, TheSensorGoesAtItsSpeedAndTurns) {
  Points still(4, 2);
  still.col(0) << 50, 0, 0, 1;
  still.col(1) << 0, 50, 0, 1;
  const MovedSweeps drive(still, 1);
  const auto place = [&](std::uint32_t i) {
    // Two fixed points tell where the sensor is: both turned by the same angle about it.
    const Points seen = drive.sweep(i);
    const Eigen::Rotation2Df back(static_cast<float>(kYawRate * kSweepPeriod * i));
    return Eigen::Vector2f(still.col(0).head<2>() - back * seen.col(0).head<2>());
  };
  constexpr float kNoise = 0.2F;
  const double chord = 2 * kSpeed / kYawRate * std::sin(kYawRate * kSweepPeriod * 10 / 2);
  EXPECT_NEAR((place(10) - place(0)).norm(), chord, kNoise);
  EXPECT_NEAR((place(kLapSweeps / 2) - place(0)).norm(), 2 * kSpeed / kYawRate, kNoise);
  const Points seen = drive.sweep(10);
  EXPECT_NEAR((seen.col(0) - seen.col(1)).head<2>().norm(), 50 * std::numbers::sqrt2, kNoise);
}

TEST(MovedSweeps, TheOwnVehicleIsLeftOut) {
  Points still(4, 2);
  still.col(0) << 1, 1, -1, 1;
  still.col(1) << 9, 0, 0, 1;
  EXPECT_EQ(MovedSweeps(still, 1).sweep(0).cols(), 1);
}

// What the ladder and the levels are for: less is worth less, and takes fewer bytes.
TEST(Clusters, OfRealSweepsAreWorthLessOnCoarserVoxels) {
  if (skips_without({"pointcloud/kitti_000008.bin"})) return;
  for (const char* file : {"kitti_000008.bin", "nuscenes_lidar_top.pcd.bin"}) {
    const MovedSweeps drive(read_cloud(*data_dir() / "pointcloud" / file), 1);
    const Points sweep = drive.sweep(5);
    const auto reference = find_clusters(sweep, cluster_levels().back());
    EXPECT_GT(reference.size(), 20U) << file;
    double before = 2;
    std::size_t bytes = SIZE_MAX;
    for (const Bytes& message : encode_cloud_ladder(sweep, 5)) {
      const double here = agreement(
          find_clusters(decode_cloud(message)->points, cluster_levels().back()), reference);
      EXPECT_LT(here, before) << file;
      EXPECT_LT(message.size(), bytes) << file;
      before = here;
      bytes = message.size();
    }
    double below = 0;
    for (const ClusterLevel& level : cluster_levels()) {
      const double here = agreement(find_clusters(sweep, level), reference);
      EXPECT_GT(here, below) << file << ' ' << level.name;
      below = here;
    }
    EXPECT_DOUBLE_EQ(below, 1) << file;
  }
}

}  // namespace
}  // namespace interneuron::perception::clusters_test
