#include "core/code/redundancy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace interneuron::code::redundancy_test {
namespace {

// The binomial tail, by its own sum.
double binomial_more(int n, int spare, double p) {
  double at_most = 0;
  for (int k = 0; k <= spare; ++k) {
    at_most += std::exp(std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1) +
                        k * std::log(p) + (n - k) * std::log1p(-p));
  }
  return 1 - at_most;
}

TEST(Redundancy, IndependentLossesAreBinomial) {
  // Bursts of 1 / (1 - p) are what independent losses have.
  for (const double p : {0.001, 0.01, 0.1}) {
    for (const int spare : {0, 1, 3, 8}) {
      EXPECT_NEAR(chance_of_more(98, static_cast<std::size_t>(spare), {p, 1 / (1 - p)}),
                  binomial_more(98, spare, p), 1e-9);
    }
  }
}

TEST(Redundancy, BurstsAreAsDrawn) {
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> u(0, 1);
  const double p = 0.02;
  const double burst = 6;
  const double enter = p / burst / (1 - p);
  int more = 0;
  constexpr int kDraws = 200'000;
  for (int i = 0; i < kDraws; ++i) {
    bool bad = u(rng) < p;
    int lost = 0;
    for (int k = 0; k < 60; ++k) {
      bad = bad ? u(rng) >= 1 / burst : u(rng) < enter;
      lost += bad ? 1 : 0;
    }
    more += lost > 5 ? 1 : 0;
  }
  EXPECT_NEAR(chance_of_more(60, 5, {p, burst}), static_cast<double>(more) / kDraws, 0.002);
}

TEST(Redundancy, ExtremesMakeSense) {
  EXPECT_EQ(symbols_for(0, 0, {0.1, 1}, 1e-3, 10), 0U);
  EXPECT_EQ(symbols_for(98, 0, {0, 1}, 1e-9, 10), 0U);
  EXPECT_EQ(symbols_for(98, 0, {1, 1}, 1e-3, 10), 0U) << "nothing arrives at all";
  EXPECT_EQ(symbols_for(20, 0, {0.2, 1.25}, 0, 10), 10U);
  EXPECT_EQ(symbols_for(98, 0, {0.01, 1}, 2, 10), 0U) << "dearer than the message";
  EXPECT_LE(symbols_for(98, 0, {0.4, 50}, 0, 500), 55U);
  EXPECT_EQ(chance_of_more(5, 5, {1, 1}), 0);
}

TEST(Redundancy, MoreIsSentForMoreLossAndForLess) {
  const auto at = [](double p, double price) { return symbols_for(98, 0, {p, 1}, price, 55); };
  EXPECT_LT(at(0.001, 1e-3), at(0.01, 1e-3));
  EXPECT_LT(at(0.01, 1e-3), at(0.05, 1e-3));
  EXPECT_LT(at(0.01, 1e-2), at(0.01, 1e-4));
}

// The whole programme: what is lost in one round is sent again in the next, with symbols of its
// own. cost[rounds][n]: of n pieces that are to leave when so many rounds follow.
TEST(Redundancy, HardlyAnyIsSentBeforeTheLastRound) {
  constexpr std::size_t kPieces = 60;
  constexpr std::size_t kMost = 12;
  const double price = 5e-4;
  for (const Losses losses : {Losses{0.01, 1}, Losses{0.03, 1}, Losses{0.01, 8}}) {
    // The probability that exactly so many of n packets are lost.
    const auto exactly = [&](std::size_t n, std::size_t lost) {
      const double more = chance_of_more(n, lost, losses);
      return (lost == 0 ? 1 : chance_of_more(n, lost - 1, losses)) - more;
    };
    std::vector<double> last(kPieces + kMost + 1);
    for (std::size_t n = 1; n < last.size(); ++n) {
      const std::size_t s = symbols_for(n, 0, losses, price, kMost);
      last[n] = chance_of_more(n + s, s, losses) + price * static_cast<double>(n + s);
    }
    std::size_t best = 0;
    double least = 1e9;
    for (std::size_t s = 0; s <= kMost; ++s) {
      double cost = price * static_cast<double>(kPieces + s);
      double rest = 1;
      for (std::size_t lost = 0; lost <= 40; ++lost) {
        const double p = exactly(kPieces + s, lost);
        rest -= p;
        if (lost > s) cost += p * last[lost - s];
      }
      cost += rest;
      if (cost < least) {
        least = cost;
        best = s;
      }
    }
    EXPECT_LE(best, 1U) << losses.share << " " << losses.burst;
    EXPECT_GT(symbols_for(kPieces, 0, losses, price, kMost), 2 * best);
  }
}

}  // namespace
}  // namespace interneuron::code::redundancy_test
