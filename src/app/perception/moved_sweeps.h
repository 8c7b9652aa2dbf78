// One recorded lidar sweep made into a drive: the sweep as a sensor would have it that moves
// through the scene. SYNTHETIC: the world stands still, what one place saw is all that is seen
// (nothing gets hidden or comes into view), and only the sensor's noise is drawn anew. It makes
// successive sweeps differ as they do on a slow bend, and says nothing of traffic.
//
// Pure; safe from any thread.
#pragma once

#include <cstdint>
#include <numbers>

#include "app/perception/point_cloud.h"

namespace interneuron::perception {

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
