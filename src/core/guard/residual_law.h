// What rounds lose against their reference, before their computation begins and after: the
// probability that a round which has lost so much before loses at most so much after. Both, because
// delays come one to a round: a round that has already lost time seldom loses more.
//
// The law is the empirical one of the last kRounds rounds, of which the newest count most; no shape
// is assumed. What was never seen is allowed for by a heavy tail that has the weight of one round.
//
// How long the rest of a round takes may contain the clock offset. Only its difference to the
// median of the last 10 s, its base, is kept: a constant offset cancels in integers, drift counts
// for 10 s, and the step of a clock costs the bases but not the law.
//
// Fed by BudgetObserver and BudgetOrigin, one law per computation. Times come from peers' bytes:
// they are clamped to an hour and subtracted with wrap-around. Nothing is allocated: 18 KB. Pure;
// thread-compatible.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "core/guard/recent.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::guard {

// Peers' bytes may make a difference of any size. One of more than an hour means nothing.
constexpr std::int64_t bounded(std::int64_t ns) {
  constexpr std::int64_t kHour = 3'600'000'000'000;
  return std::clamp(ns, -kHour, kHour);
}

class ResidualLaw {
 public:
  // 51 s at 10 rounds per second.
  static constexpr std::size_t kRounds = 512;
  // A round that lies back so many rounds counts half of the newest one, and one that lies back n
  // times as many 1 / (1 + n): losses come in spells (docs/guard.md, "What it knows").
  static constexpr std::size_t kHalf = 16;
  // A share of fewer rounds than this is mostly chance.
  static constexpr std::size_t kLeast = 4;

  struct Sample {
    RoundId round{};
    // The base that `rest` belongs to.
    std::uint8_t key = 0;
    // By how much the computation began later than its reference, and by how much it took longer
    // than was expected of it.
    Duration before{};
    Duration computed{};
    // How long the rest of the round took, clock offset included. Of a round that was not answered
    // all that is known is that it lost more than this after its computation began.
    Duration rest{};
    bool answered = true;
  };
  // Takes the place of what was known of the same round.
  void add(TimePoint now, const Sample& sample);

  // The median of the rest over the last 10 s, clock offset included; without a key, of all.
  std::optional<Duration> base(TimePoint now, std::optional<std::uint8_t> key) const;

  // The probability that a round of a kind never seen loses more than `slack`:
  // (scale / (scale + slack))².
  double tail(Duration slack) const;
  void set_scale(Duration scale) { scale_ = scale; }

  // The rounds that had lost about as much before: those within `width` of `before`, or the kLeast
  // nearest ones where those are fewer. Without `before`: all.
  class Near;
  Near near(std::optional<Duration> before, Duration width) const;

  // A clock has stepped: differences stay, and what contains the clock offset goes.
  void drop_bases() { rests_.clear(); }

 private:
  struct Loss {
    RoundId round{};
    bool answered = false;
    std::int64_t before = 0;
    // Where not answered, the least that it can be.
    std::int64_t after = 0;
  };
  // How many newer ones than this entry of losses_ there are; 0: it is the newest.
  std::size_t age(std::size_t i) const { return (next_ + kRounds - 1 - i) % kRounds; }

  std::array<Loss, kRounds> losses_{};
  std::size_t next_ = 0;
  std::size_t size_ = 0;
  Recent rests_;
  Duration scale_ = std::chrono::milliseconds(20);
};

// Rounds of the law that are alike, as they were when near() was called.
class ResidualLaw::Near {
 public:
  // The probability that a round loses at most `slack` from here on.
  double within(Duration slack) const;

 private:
  friend class ResidualLaw;
  struct Weighed {
    std::int64_t after = 0;
    float weight = 0;
    bool answered = false;
  };
  const ResidualLaw* law_ = nullptr;
  std::array<Weighed, kRounds> rounds_;
  std::size_t size_ = 0;
  double weight_ = 0;
};

}  // namespace interneuron::guard
