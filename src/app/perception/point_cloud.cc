#include "app/perception/point_cloud.h"

#include <Eigen/Geometry>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <unordered_map>

#include "app/perception/big_endian.h"
#include "app/perception/openable.h"
#include "app/perception/voxel_key.h"

namespace interneuron::perception {
namespace {

static_assert(std::endian::native == std::endian::little, "points travel as they lie in memory");

// "PC", the first two bytes of a point cloud message.
constexpr std::uint16_t kCloudMagic = 0x5043;
constexpr std::uint8_t kCloudVersion = 1;
constexpr int kKittiFields = 4;
constexpr int kNuScenesFields = 5;
// Each about half of the one before, in bytes of the nuScenes sweep (docs/constants.md, "Point
// clouds and clusters").
constexpr CloudRung kRungs[] = {{"full", 0}, {"10cm", 0.1}, {"20cm", 0.2}, {"40cm", 0.4}};

// The first point that is not finite or too far away, or -1.
Eigen::Index first_bad(const Points& points) {
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto p = points.col(i);
    if (!p.allFinite() || p.head<3>().cwiseAbs().maxCoeff() > kMaxCoordinate) return i;
  }
  return -1;
}

int fields_of(const std::filesystem::path& file) {
  return file.filename().string().ends_with(".pcd.bin") ? kNuScenesFields : kKittiFields;
}

std::string layout_of(int fields) {
  return fields == kKittiFields ? "KITTI, 4 floats per point" : "nuScenes, 5 floats per point";
}

std::vector<float> read_floats(const std::filesystem::path& file, int fields) {
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  if (!in) check_openable("point cloud", file);
  if (!in || std::filesystem::is_directory(file)) {
    throw InputError(file.string() + ": cannot be read; give a KITTI .bin or nuScenes .pcd.bin");
  }
  const auto bytes = static_cast<std::size_t>(in.tellg());
  const std::size_t point_bytes = static_cast<std::size_t>(fields) * sizeof(float);
  const std::size_t count = bytes / point_bytes;
  if (bytes == 0 || bytes % point_bytes != 0 || count > kMaxPoints) {
    throw InputError(file.string() + ": " + std::to_string(bytes) + " bytes are not 1 to " +
                     std::to_string(kMaxPoints) + " points (" + layout_of(fields) +
                     "); give a KITTI .bin or nuScenes .pcd.bin");
  }
  std::vector<float> values(count * static_cast<std::size_t>(fields));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(bytes));
  if (!in) throw InputError(file.string() + ": cannot be read to its end; copy it again");
  return values;
}

// The standard deviation of a range, m: the data sheets of the sensors of both data sets (Velodyne
// HDL-64E and HDL-32E) say 2 cm.
constexpr float kRangeNoise = 0.02F;

std::mt19937_64 generator(std::uint64_t seed, std::uint32_t stream) {
  std::seed_seq sequence{seed & 0xFFFF'FFFF, seed >> 32, std::uint64_t{stream}};
  return std::mt19937_64(sequence);
}

Points without_own_vehicle(const Points& points) {
  Points out(4, points.cols());
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    if (points.col(i).head<2>().norm() >= kOwnVehicle) out.col(kept++) = points.col(i);
  }
  out.conservativeResize(Eigen::NoChange, kept);
  return out;
}

}  // namespace

Points read_cloud(const std::filesystem::path& file) {
  const int fields = fields_of(file);
  const std::vector<float> values = read_floats(file, fields);
  const auto count = static_cast<Eigen::Index>(values.size()) / fields;
  Points points =
      Eigen::Map<const Eigen::MatrixXf>(values.data(), fields, count).topRows<kKittiFields>();
  if (const Eigen::Index bad = first_bad(points); bad >= 0) {
    throw InputError(file.string() + ": point " + std::to_string(bad) +
                     " is not finite or beyond 10 km (read as " + layout_of(fields) +
                     "); give a KITTI .bin or nuScenes .pcd.bin");
  }
  return points;
}

Points voxel_grid(const Points& points, double side_m) {
  assert(side_m >= kMinVoxel && side_m <= kMaxVoxel);
  const auto side = static_cast<float>(side_m);
  std::unordered_map<std::uint64_t, std::size_t, VoxelHash> index;
  index.reserve(static_cast<std::size_t>(points.cols()) / 2);
  std::vector<Eigen::Vector4d> sums;
  std::vector<int> counts;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector4f point = points.col(i);
    const auto [at, is_new] =
        index.try_emplace(key_of(voxel_of(point.head<3>(), side)), sums.size());
    if (is_new) {
      sums.emplace_back(Eigen::Vector4d::Zero());
      counts.push_back(0);
    }
    sums[at->second] += point.cast<double>();
    ++counts[at->second];
  }
  Points out(4, static_cast<Eigen::Index>(sums.size()));
  for (std::size_t i = 0; i < sums.size(); ++i) {
    out.col(static_cast<Eigen::Index>(i)) = (sums[i] / counts[i]).cast<float>();
  }
  return out;
}

Points stride(const Points& points, int n) {
  assert(n >= 1);
  Points out(4, (points.cols() + n - 1) / n);
  for (Eigen::Index i = 0; i < out.cols(); ++i) out.col(i) = points.col(i * n);
  return out;
}

Bytes encode_cloud(const Cloud& cloud) {
  const auto count = static_cast<std::size_t>(cloud.points.cols());
  assert(count <= kMaxPoints);
  Bytes out;
  out.reserve(kCloudHeaderBytes + count * kPointBytes);
  append(out, kCloudMagic);
  append(out, kCloudVersion);
  append(out, static_cast<std::uint8_t>(cloud.variant));
  append(out, cloud.frame);
  append(out, static_cast<std::uint32_t>(count));
  const ByteView points = std::as_bytes(std::span(cloud.points.data(), 4 * count));
  out.insert(out.end(), points.begin(), points.end());
  return out;
}

std::span<const CloudRung> cloud_rungs() { return kRungs; }

std::vector<Bytes> encode_cloud_ladder(const Points& points, std::uint32_t frame) {
  std::vector<Bytes> out;
  for (const CloudRung& rung : kRungs) {
    out.push_back(rung.side_m > 0 ? encode_cloud({voxel_grid(points, rung.side_m),
                                                  CloudVariant::kVoxels, frame})
                                  : encode_cloud({points, CloudVariant::kRaw, frame}));
  }
  return out;
}

std::optional<Cloud> decode_cloud(ByteView bytes) {
  ByteReader in(bytes);
  if (in.get<std::uint16_t>() != kCloudMagic || in.get<std::uint8_t>() != kCloudVersion) return {};
  const auto variant = in.get<std::uint8_t>();
  Cloud cloud{.variant = static_cast<CloudVariant>(variant), .frame = in.get<std::uint32_t>()};
  const auto count = in.get<std::uint32_t>();
  if (!in.ok() || variant >= kCloudVariants || count > kMaxPoints) return {};
  if (in.rest().size() != count * kPointBytes) return {};
  cloud.points.resize(4, static_cast<Eigen::Index>(count));
  if (count > 0) std::memcpy(cloud.points.data(), in.rest().data(), in.rest().size());
  if (first_bad(cloud.points) >= 0) return {};
  return cloud;
}

MovedSweeps::MovedSweeps(const Points& still, std::uint64_t seed)
    : still_(without_own_vehicle(still)), seed_(seed) {
  std::mt19937_64 rng = generator(seed, kLapSweeps);
  heading_ = std::uniform_real_distribution<double>(0, 2 * std::numbers::pi)(rng);
}

Points MovedSweeps::sweep(std::uint32_t index) const {
  const std::uint32_t number = index % kLapSweeps;
  const double turned = kYawRate * kSweepPeriod * number;
  const double radius = kSpeed / kYawRate;
  // A body that starts along x and turns left is here after it has turned so far.
  const Eigen::Vector2d went(radius * std::sin(turned), radius * (1 - std::cos(turned)));
  const Eigen::Vector2f at = (Eigen::Rotation2Dd(heading_) * went).cast<float>();
  const Eigen::Rotation2Df back(static_cast<float>(-turned));
  std::mt19937_64 rng = generator(seed_, number);
  std::normal_distribution<float> noise(0, kRangeNoise);
  Points out = still_;
  for (Eigen::Index i = 0; i < out.cols(); ++i) {
    out.col(i).head<2>() = back * (out.col(i).head<2>() - at);
    const float range = out.col(i).head<3>().norm();
    if (range > 0) out.col(i).head<3>() *= 1 + noise(rng) / range;
  }
  return out;
}

}  // namespace interneuron::perception
