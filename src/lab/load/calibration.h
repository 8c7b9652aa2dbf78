// Whether predicted chances are kept: what was predicted beside what happened, in bins of what was
// predicted. Pure; thread-safe; no errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace interneuron::load {

struct Forecast {
  // P(on time), in [0, 1].
  double predicted = 0;
  bool on_time = false;
  // send() refused the message; it was sent nevertheless.
  bool refused = false;
  // The run and its second in which the message was sent: messages of one second share their fate.
  std::uint64_t second = 0;
};

struct Bin {
  // Means over the bin's messages.
  double predicted = 0;
  double happened = 0;
  std::size_t messages = 0;
  // Of happened - predicted, if only the seconds are independent of each other and not the messages
  // within them.
  double standard_error = 0;

  double gap() const { return happened - predicted; }
  // Within two points and three standard errors.
  bool kept() const;
};

// A bin has at least so many messages, else it is joined to its neighbour.
inline constexpr std::size_t kLeastInBin = 2500;

// The mean square of prediction minus what happened, 1 or 0 (Brier, Verification of Forecasts
// Expressed in Terms of Probability, 1950): 0 is best, 0.25 what even odds get. 0 without
// forecasts.
double brier_score(std::span<const Forecast> forecasts);

// Bins of rising predictions. A last one that has too few is there alone where all have too few.
std::vector<Bin> calibration(std::span<const Forecast> forecasts, std::size_t least = kLeastInBin);

}  // namespace interneuron::load
