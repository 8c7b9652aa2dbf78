// A lidar sweep for the examples: read or made up, thinned, and as a message. (The program's own
// codec, src/app/perception/point_cloud.h, is not part of the library.)
#pragma once

#include <interneuron/units.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

namespace examples {

// x, y and z in metres, then the intensity, as the files of the KITTI data set have them.
using Point = std::array<float, 4>;
using Sweep = std::vector<Point>;

inline Sweep read_kitti(const std::string& file) {
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  const auto bytes = in ? static_cast<std::size_t>(std::max<std::streamoff>(in.tellg(), 0)) : 0;
  if (bytes == 0 || bytes % sizeof(Point) != 0) {
    throw std::runtime_error(file + ": no KITTI sweep (x y z intensity as floats); give a .bin");
  }
  Sweep sweep(bytes / sizeof(Point));
  in.seekg(0).read(reinterpret_cast<char*>(sweep.data()), static_cast<std::streamsize>(bytes));
  return sweep;
}

// Ground around a sensor 1.7 m above it, in 32 rings of 1,000 points.
inline Sweep made_up() {
  Sweep sweep;
  for (int ring = 1; ring <= 32; ++ring) {
    const float range = 1.7F / std::tan(0.012F * static_cast<float>(ring));
    for (int i = 0; i < 1000; ++i) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / 1000;
      sweep.push_back({range * std::cos(angle), range * std::sin(angle), -1.7F, 0.5F});
    }
  }
  return sweep;
}

// The first point in each cube of this side.
inline Sweep thinned(const Sweep& sweep, float side_m) {
  std::map<std::array<int, 3>, Point> voxels;
  for (const Point& p : sweep) {
    std::array<int, 3> at{};
    for (std::size_t i = 0; i < 3; ++i) at[i] = static_cast<int>(std::floor(p[i] / side_m));
    voxels.try_emplace(at, p);
  }
  Sweep out;
  for (const auto& [at, point] : voxels) out.push_back(point);
  return out;
}

inline interneuron::Bytes to_message(const Sweep& sweep) {
  interneuron::Bytes bytes(sweep.size() * sizeof(Point));
  std::memcpy(bytes.data(), sweep.data(), bytes.size());
  return bytes;
}

}  // namespace examples
