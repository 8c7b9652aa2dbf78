// The cells of a grid of cubes through the sensor, as numbers. Pure functions.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

namespace interneuron::perception {

using Voxel = Eigen::Vector3i;

// Which cube of this side, m, a point lies in.
inline Voxel voxel_of(const Eigen::Vector3f& point, float side) {
  return (point / side).array().floor().cast<int>();
}

// Three signed coordinates of 21 bits each: kMaxCoordinate / kMinVoxel is below 2^20, so that
// voxels within bounds, and their neighbours, have keys of their own.
inline std::uint64_t key_of(const Voxel& voxel) {
  std::uint64_t key = 0;
  for (const int cell : voxel) key = (key << 21) | (static_cast<std::uint64_t>(cell) & 0x1F'FFFF);
  return key;
}

// Neighbouring voxels differ in few bits; the multiplier is that of splitmix64.
struct VoxelHash {
  std::size_t operator()(std::uint64_t key) const {
    key *= 0xBF58476D1CE4E5B9U;
    return key ^ (key >> 32);
  }
};

}  // namespace interneuron::perception
