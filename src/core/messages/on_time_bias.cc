#include "core/messages/on_time_bias.h"

#include <algorithm>

namespace interneuron {
namespace {

// How far a prediction of 1 that was wrong moves a part that it is at. Larger steps find a bias
// sooner and make predictions less steady; chosen on the seeds that the laws were fitted on.
constexpr double kStep = 0.15;
// The largest part, in log-odds: far from certainty to far from it.
constexpr double kMostBias = 6;
// The log-odds around which there is a part of its own: 18, 62, 92 and 99 %.
constexpr std::array kAt{-1.5, 0.5, 2.5, 4.5};

// The last part that is not above, and how far it is from it to the next.
struct Place {
  std::size_t below = 0;
  double part = 0;
};

Place place(double log_odds) {
  const double inside = std::clamp(log_odds, kAt.front(), kAt.back());
  std::size_t below = 0;
  while (below + 2 < kAt.size() && kAt[below + 1] <= inside) ++below;
  return {below, (inside - kAt[below]) / (kAt[below + 1] - kAt[below])};
}

void move(double& bias, double by) { bias = std::clamp(bias + by, -kMostBias, kMostBias); }

}  // namespace

double OnTimeBias::at(double log_odds) const {
  const auto [below, part] = place(log_odds);
  return around_[below] * (1 - part) + around_[below + 1] * part;
}

void OnTimeBias::learn(double log_odds, double predicted, double on_time) {
  const auto [below, part] = place(log_odds);
  const double by = kStep * (on_time - predicted);
  move(around_[below], by * (1 - part));
  move(around_[below + 1], by * part);
}

}  // namespace interneuron
