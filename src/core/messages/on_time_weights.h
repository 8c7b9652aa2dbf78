// The weights of OnTimeForecasts, which are its only constants that were fitted. Plain values.
//
// Source: logistic regression (Newton's method, a ridge of 1/2 per weight) on 713,000 messages
// under load and 239,000 of drives, of which 20,000 had been refused (docs/load.md, "What send()
// predicts"): seeds 1 and 2 of rate, size and vehicles, 1 to 12 of all others. Every other seed is
// for judging. The knots are the mean log-odds that the regression said and the log-odds of the
// share that happened, made not to fall, between the quantiles 0, 1, 3, 6, 12, 25, 40, 60, 80, 92
// and 100 % of what it said. Weights were fitted together, so that none means anything alone.
#pragma once

#include <array>

namespace interneuron {

// What on_time_forecast.cc computes of a message, each about within [-1, 1.5], in this order: one;
// the slack by its uncertainty; a suspect path; how overdue other messages are; the spread of round
// trips; loss; the slack by the deadline; the slack by the record of the peer from -2 to 0, 0 to 1
// and 1 to 3 times its spread; the share on time; messages ahead; messages under way; the part of
// the rate that is others'; the queue; the time on the air; that and the part of others, each times
// the share on time.
using OnTimeFeatures = std::array<double, 18>;

struct OnTimeLaw {
  // The sum of weighted features are log-odds.
  OnTimeFeatures weights;
  // The log-odds that were said, rising, and those that were seen.
  struct Knot {
    double said = 0;
    double seen = 0;
  };
  std::array<Knot, 10> knots;
};

// Nothing of our own is sent before it, and no others use the link.
inline constexpr OnTimeLaw kIdleLaw{
    {1.207, 1.055, -3.123, -5.648, -1.379, -3.475, 3.105, 0.561, 1.464, -0.278, 1.376, 0.000, 3.940,
     1.160, 0.835, -1.905, -3.060, 0.728},
    {{{-2.246, -1.701},
      {1.749, 1.685},
      {3.353, 3.227},
      {3.736, 3.415},
      {4.295, 4.085},
      {6.246, 6.647},
      {7.094, 8.292},
      {7.418, 12.005},
      {7.916, 12.005},
      {8.009, 12.005}}}};
// It competes with our own messages, or with others.
inline constexpr OnTimeLaw kLoadedLaw{
    {-2.343, 8.604, -3.308, -2.003, -3.575, 0.317, -4.654, 1.136, 1.473, 1.683, 2.153, 4.344,
     -9.071, 4.953, 5.489, -0.211, -3.849, -1.877},
    {{{-3.026, -1.325},
      {-1.540, -0.856},
      {-0.964, -0.627},
      {-0.424, -0.453},
      {0.197, -0.075},
      {0.807, 0.672},
      {1.565, 1.662},
      {2.696, 3.056},
      {5.013, 4.310},
      {7.257, 7.099}}}};
// It is expected too late.
inline constexpr OnTimeLaw kRefusedLaw{
    {3.032, 3.239, -1.241, -1.235, -3.554, -1.946, 0.000, 0.374, -0.780, 1.147, 0.792, -0.437,
     2.983, -1.539, -1.829, -1.104, -1.781, 3.222},
    {{{-7.265, -6.004},
      {-6.441, -6.004},
      {-5.790, -6.004},
      {-5.072, -5.081},
      {-3.594, -4.210},
      {-1.878, -2.049},
      {-0.317, -0.089},
      {0.818, 0.867},
      {1.444, 1.166},
      {1.931, 1.796}}}};

}  // namespace interneuron
