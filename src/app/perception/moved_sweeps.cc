#include "app/perception/moved_sweeps.h"

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace interneuron::perception {
namespace {

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
