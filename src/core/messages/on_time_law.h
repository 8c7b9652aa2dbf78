// By which law OnTimeForecasts weighs what it knows of a message. Plain values.
#pragma once

#include <array>
#include <cstddef>

namespace interneuron {

// What OnTimeRecord::features() says of a message, each about within [-1, 1.5].
inline constexpr std::size_t kOnTimeFeatures = 39;
using OnTimeFeatures = std::array<double, kOnTimeFeatures>;

struct OnTimeLaw {
  // The sum of weighted features is what it says, in log-odds.
  OnTimeFeatures weights;
  // What it says, rising, and the log-odds of the share that was on time of such messages.
  struct Knot {
    double said = 0;
    double seen = 0;
  };
  std::array<Knot, 12> knots;
};

struct OnTimeLaws {
  // Nothing of our own is under way, and no others use the link.
  OnTimeLaw idle;
  // It competes with our own messages, or with others.
  OnTimeLaw loaded;
  // It is expected too late.
  OnTimeLaw refused;
};

}  // namespace interneuron
