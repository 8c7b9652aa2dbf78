// By how much the law of OnTimeForecasts is wrong of one peer. Pure.
#pragma once

#include <array>
#include <cstddef>

namespace interneuron {

// What is to be added to the log-odds that a law says, learnt from what became of messages: a part
// around each of a few log-odds, between which it goes in a line. Each fate moves the two parts of
// its message by a little of what the prediction was off (the gradient of its logarithmic loss). So
// predictions do not stay too high or too low on average, whatever the law says: while no part is
// at its bound, the errors of n messages sum up to how far the parts have moved over kStep. Plain
// values; pure; thread-compatible.
class OnTimeBias {
 public:
  double at(double log_odds) const;
  // A message of which the law said these log-odds, and of which this was predicted (with the bias
  // as it was then), was on time (1) or not (0).
  void learn(double log_odds, double predicted, double on_time);

 private:
  std::array<double, 4> around_{};
};

}  // namespace interneuron
