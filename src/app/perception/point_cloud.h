// Lidar sweeps: reading them, thinning them, their form as messages, and drives made of one.
//
// Wire format: a header of 12 bytes, big-endian, then the points:
//
//   offset size field
//        0    2 magic 0x5043, "PC"
//        2    1 version, 1
//        3    1 variant: 0 raw, 1 voxels, 2 stride
//        4    4 frame: 0-based index in the source
//        8    4 count of points, at most kMaxPoints
//       12   16·count: per point x, y, z in m, intensity; binary32, little-endian as in the data
//       sets
//
// Pure functions but for read_cloud(): safe from any thread.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "app/perception/input_error.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron::perception {

// A column per point: x, y, z in m from the sensor, intensity in the sensor's unit. Finite, and no
// coordinate beyond kMaxCoordinate.
using Points = Eigen::Matrix<float, 4, Eigen::Dynamic>;

// Coordinates reach this far, in metres, which no lidar does.
inline constexpr float kMaxCoordinate = 10'000;
inline constexpr std::size_t kPointBytes = 4 * sizeof(float);
inline constexpr std::size_t kCloudHeaderBytes = 12;
inline constexpr std::size_t kMaxPoints = (kMaxMessageBytes - kCloudHeaderBytes) / kPointBytes;

// Reads KITTI's .bin (x y z intensity, binary32 little-endian) or, where the name ends in .pcd.bin,
// nuScenes' (x y z intensity ring; the ring is left out). Throws InputError when the file is
// missing, empty, too large, no whole number of points, or a point is out of bounds.
Points read_cloud(const std::filesystem::path& file);

// Side of a voxel, m: 0.01 … 100.
inline constexpr double kMinVoxel = 0.01;
inline constexpr double kMaxVoxel = 100;

// One point per voxel of a grid through the sensor: the centroid of those in it, with their mean
// intensity; in the order in which voxels first appear. The same side gives the same grid for every
// sweep. Takes 25 million points per second and core (bench/cloud_bench.cc, 115,200 points, 0.2 m).
// Requires kMinVoxel <= side_m <= kMaxVoxel.
Points voxel_grid(const Points& points, double side_m);

// Every n-th point, starting with the first; n >= 1.
Points stride(const Points& points, int n);

enum class CloudVariant : std::uint8_t { kRaw = 0, kVoxels = 1, kStride = 2 };
inline constexpr std::size_t kCloudVariants = 3;

// One variant of one sweep.
struct Cloud {
  Points points{};
  CloudVariant variant = CloudVariant::kRaw;
  // The index in the source, from 0.
  std::uint32_t frame = 0;
};

// Requires at most kMaxPoints points.
Bytes encode_cloud(const Cloud& cloud);

// One rung of the ladder of variants.
struct CloudRung {
  // "full", "10cm" and so on.
  const char* name;
  // Side of the voxels, m; 0: all points are sent.
  double side_m;
};
// The best one first, as policies expect.
std::span<const CloudRung> cloud_rungs();

// One message for each of cloud_rungs(). Requires at most kMaxPoints points.
std::vector<Bytes> encode_cloud_ladder(const Points& points, std::uint32_t frame);

// The sweep in a message, or nothing if the bytes are not exactly one. Any bytes will do; never
// throws on them. Its points are finite and within bounds.
std::optional<Cloud> decode_cloud(ByteView bytes);

// One recorded lidar sweep made into a drive: the sweep as a sensor would have it that moves
// through the scene. SYNTHETIC: the world stands still, what one place saw is all that is seen
// (nothing gets hidden or comes into view), and only the sensor's noise is drawn anew. It makes
// successive sweeps differ as they do on a slow bend, and says nothing of traffic. Pure; safe from
// any thread.
//
// The sensor goes round a circle of 16 m radius in 20 s, as on a roundabout: the scene stays in
// sight, and after a lap the same sweeps come again.
inline constexpr double kSpeed = 5;                            // m/s
inline constexpr double kYawRate = 2 * std::numbers::pi / 20;  // rad/s
inline constexpr double kSweepPeriod = 0.1;                    // s
inline constexpr std::uint32_t kLapSweeps = 200;
// What is nearer to the sensor than this, seen from above, is its own vehicle, m; it is left out.
// In the nuScenes sweep a quarter of the points are within 2 m, and none between 2 and 3 m.
inline constexpr float kOwnVehicle = 2.5F;

class MovedSweeps {
 public:
  // `still`: the sweep at the start. The seed determines the direction in which the sensor starts,
  // and the noise. Requires that no coordinate of `still` is within 100 m of kMaxCoordinate.
  MovedSweeps(const Points& still, std::uint64_t seed);

  // The sweep of that number, in the frame of the sensor at that instant: x ahead, y to the left.
  // Sweep i + kLapSweeps is sweep i. The same number gives the same sweep.
  Points sweep(std::uint32_t index) const;

 private:
  Points still_;
  std::uint64_t seed_;
  double heading_;
};

}  // namespace interneuron::perception
