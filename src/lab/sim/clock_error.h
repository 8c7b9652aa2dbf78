// How far a host's clock of the simulation is from the world's. It shows offset + t + t * drift at
// world time t. In reality the offsets of two hosts may differ by any amount, and quartz drifts by
// some 20 ppm. A plain value; pure.
#pragma once

#include <cstdint>

#include "interneuron/time.h"

namespace interneuron::sim {

struct ClockError {
  Duration offset{};
  std::int64_t drift_ppm = 0;

  // What the clock shows at world time `t`.
  TimePoint local(Duration t) const;
  // The first instant of world time at which the clock has reached `t`.
  Duration world(TimePoint t) const;
};

}  // namespace interneuron::sim
