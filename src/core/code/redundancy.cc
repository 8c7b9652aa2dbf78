#include "core/code/redundancy.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/code/blocks.h"

namespace interneuron::code {
namespace {

// Bursts that are alike in length have this many packets more than the shortest at most; longer
// ones are taken for as long as that and some.
constexpr std::size_t kMostFixed = 15;

// The number of packets lost so far, by the fate of the newest packet. Losses beyond `most` are not
// followed: they are too many whatever follows.
class Run {
 public:
  Run(const Losses& losses, std::size_t most) : most_(std::min(most, kMostRows)) {
    const double share = std::clamp(losses.share, 0.0, 1.0);
    const double burst = std::max(losses.burst, 1.0);
    // A burst is `fixed_` packets and then a geometric number of them, which alone varies: by
    // sqrt(1 - q) / q, where q is the probability that the burst ends.
    const double variance = losses.deviation * losses.deviation;
    leave_ = losses.deviation < 0 ? 1 / burst
             : variance < 1e-6    ? 1
                                  : (std::sqrt(1 + 4 * variance) - 1) / (2 * variance);
    const double fixed = std::clamp(burst - 1 / leave_, 0.0, static_cast<double>(kMostFixed));
    fixed_ = static_cast<std::size_t>(fixed + 0.5);
    leave_ = 1 / std::max(1.0, burst - static_cast<double>(fixed_));
    // So that the share of lost packets is what it is in the long run.
    enter_ = share < 1 ? std::min(1.0, share / burst / (1 - share)) : 1;
    // The packet before the first one, which is not counted.
    good_[0] = 1 - share;
    bad_[0][0] = share;
  }

  void packet() {
    for (std::size_t lost = most_ + 1; lost-- > 0;) {
      // What was lost before a lost packet was one less.
      const auto before = [&](const Counts& of) { return lost > 0 ? of[lost - 1] : 0; };
      const double begins = before(good_) * enter_;
      good_[lost] = good_[lost] * (1 - enter_) + bad_[0][lost] * leave_;
      const double stays = before(bad_[0]) * (1 - leave_);
      for (std::size_t left = 0; left < fixed_; ++left) bad_[left][lost] = before(bad_[left + 1]);
      bad_[fixed_][lost] = begins;
      bad_[0][lost] += stays;
    }
  }
  double at_most(std::size_t spare) const {
    double sum = 0;
    for (std::size_t lost = 0; lost <= std::min(spare, most_); ++lost) {
      sum += good_[lost];
      for (std::size_t left = 0; left <= fixed_; ++left) sum += bad_[left][lost];
    }
    return sum;
  }

 private:
  using Counts = std::array<double, kMostRows + 1>;
  std::size_t most_;
  std::size_t fixed_ = 0;
  double leave_ = 1;
  double enter_ = 0;
  Counts good_{};
  // By how many packets of the burst are still certain to be lost.
  std::array<Counts, kMostFixed + 1> bad_{};
};

}  // namespace

double chance_of_more(std::size_t packets, std::size_t spare, const Losses& losses) {
  if (spare >= packets) return 0;
  Run run(losses, spare);
  for (std::size_t i = 0; i < packets; ++i) run.packet();
  return std::clamp(1 - run.at_most(spare), 0.0, 1.0);
}

std::size_t symbols_for(std::size_t packets, std::size_t spare, const Losses& losses, double price,
                        std::size_t most) {
  if (packets <= spare || losses.share <= 0 || spare >= kMostRows) return 0;
  most = std::min(most, kMostRows - spare);
  Run run(losses, spare + most);
  for (std::size_t i = 0; i < packets; ++i) run.packet();
  std::size_t best = 0;
  double least = 1 - run.at_most(spare);
  for (std::size_t more = 1; more <= most; ++more) {
    run.packet();
    const double cost = 1 - run.at_most(spare + more) + price * static_cast<double>(more);
    if (cost < least) {
      least = cost;
      best = more;
    }
  }
  return best;
}

}  // namespace interneuron::code
