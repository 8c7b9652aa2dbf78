#include "lab/sim/host.h"

namespace interneuron::sim {

namespace {

constexpr std::int64_t kMillion = 1'000'000;

}  // namespace

TimePoint ClockError::local(Duration t) const {
  return TimePoint{
      offset + t +
      Duration{t.count() / kMillion * drift_ppm + t.count() % kMillion * drift_ppm / kMillion}};
}

Duration ClockError::world(TimePoint t) const {
  const std::int64_t elapsed = (t.time_since_epoch() - offset).count();
  const auto guess = static_cast<std::int64_t>(static_cast<long double>(elapsed) * kMillion /
                                               static_cast<long double>(kMillion + drift_ppm));
  Duration w{guess - 2};
  while (local(w) < t) w += Duration{1};
  return w;
}

}  // namespace interneuron::sim
