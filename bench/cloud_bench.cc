// Times the thinning of point clouds on a synthetic sweep of 64 rings over ground and walls, as a
// roof lidar gives ten times a second. The aim is 300,000 points per second and core
// (docs/constants.md, "Aims of the benchmarks").
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "app/perception/point_cloud.h"

namespace interneuron::bench {
namespace {

using namespace perception;

constexpr int kRings = 64;
// A point every 0.2 degrees.
constexpr int kPerRing = 1800;
// Metres above the ground.
constexpr float kSensorHeight = 1.7F;
// The walls are the sides of a square; half of a side, in metres.
constexpr float kWall = 25;

// One turn of the lidar: 115,200 points of x, y, z in metres and an intensity.
Points sweep() {
  Points points(4, kRings * kPerRing);
  for (int ring = 0; ring < kRings; ++ring) {
    const float down =
        (-2.0F + 27.0F * static_cast<float>(ring) / kRings) * std::numbers::pi_v<float> / 180;
    for (int i = 0; i < kPerRing; ++i) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / kPerRing;
      const float x = std::cos(angle);
      const float y = std::sin(angle);
      const float to_wall = kWall / std::max(std::abs(x), std::abs(y));
      const float to_ground = down > 0 ? kSensorHeight / std::tan(down) : to_wall;
      const float range = std::min(to_wall, to_ground);
      points.col(ring * kPerRing + i) << x * range, y * range, -std::tan(down) * range, 0.5F;
    }
  }
  return points;
}

void per_point(benchmark::State& bench, const Points& points) {
  bench.SetItemsProcessed(bench.iterations() * points.cols());
}

// The argument is the side of a voxel, in centimetres.
void voxels(benchmark::State& bench) {
  const Points points = sweep();
  const double side = static_cast<double>(bench.range(0)) / 100;
  for (auto _ : bench) benchmark::DoNotOptimize(voxel_grid(points, side).data());
  per_point(bench, points);
}
BENCHMARK(voxels)->Arg(10)->Arg(20)->Arg(40);

void every_fourth(benchmark::State& bench) {
  const Points points = sweep();
  for (auto _ : bench) benchmark::DoNotOptimize(stride(points, 4).data());
  per_point(bench, points);
}
BENCHMARK(every_fourth);

// What a vehicle does per sweep: thin it, and write all variants.
void encode_ladder(benchmark::State& bench) {
  const Points points = sweep();
  for (auto _ : bench) benchmark::DoNotOptimize(encode_cloud_ladder(points, 0).data());
  per_point(bench, points);
}
BENCHMARK(encode_ladder);

}  // namespace
}  // namespace interneuron::bench

BENCHMARK_MAIN();
