// What rounds lose against their reference: per round the pair (before, after) the computation
// began, and the probability that a round which has lost so much before loses at most so much
// after. Pairs, because delays come one to a round: a round that has already lost time seldom loses
// more.
//
// "After" is by how much the computation exceeded what was expected of it, plus by how much the
// rest of the round exceeded its base. The rest may contain the clock offset: it is kept as it came
// for 10 s, with its median as the base, and as the difference to that base afterwards. So a
// constant offset cancels in integers, drift counts for 10 s only, and the step of a clock costs
// the bases but not the law.
//
// The law is the empirical one of the last kRounds rounds; no shape is assumed. What was never seen
// is allowed for by a heavy tail that has the weight of one round among all of them.
//
// Fed by BudgetObserver and BudgetOrigin, one law per computation. Times come from peers' bytes:
// they are clamped to an hour and subtracted with wrap-around. Nothing is allocated: 45 KB. Pure;
// thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::guard {

class Speed;

// The probability that a round is on time.
struct Chance {
  // The share of alike rounds that were, if one more had been late, and if one more had been on
  // time: the range that is known of it.
  double least = 0;
  double most = 0;
  // The share with the tail of what was never seen.
  double hedged = 0;
  friend bool operator==(const Chance&, const Chance&) = default;
};
inline Chance chance(double on_time, double rounds, double hedged) {
  return {on_time / (rounds + 1), (on_time + 1) / (rounds + 1), hedged};
}

class ResidualLaw {
 public:
  // 51 s at 10 rounds per second: a probability of .99 rests on five late rounds.
  static constexpr std::size_t kRounds = 512;
  // Rounds that a base is the median of, at most: 12.8 s at 10 rounds per second.
  static constexpr std::size_t kFresh = 128;
  // Bases: 8 variants, degraded or not.
  static constexpr std::size_t kKeys = 16;

  struct Sample {
    RoundId round{};
    TimePoint at{};
    // The base that `rest` belongs to, < kKeys.
    std::uint8_t key = 0;
    // By how much the computation began later than its reference.
    Duration before{};
    // The last computation of the round.
    struct Run {
      std::size_t level = 0;
      // The median of the level, as its node tells it.
      Duration median{};
      Duration took{};
    } run;
    // By how much that computation exceeded what was expected of it.
    Duration computed{};
    // kKnown: how long the rest of the round took, clock offset included. kBeyond: the round was
    // not answered, and all that is known is that before + after of it exceeds this.
    Duration rest{};
    enum class Kind : std::uint8_t { kKnown, kBeyond } kind = Kind::kKnown;
  };
  // A sample of the same round takes the place of what was known of it.
  void add(TimePoint now, const Sample& sample);

  // What is expected of computations has changed. Each sample of the last 10 s is then judged by
  // what was expected when it ran or is expected now, whichever explains it better: a node that
  // becomes slower (or fast again) is learnt once, and not remembered as a chain of accidents.
  void reconsider(const Speed& speed);

  // The median of the rest over the last 10 s, clock offset included. Where there is no such
  // sample, the last median of the last 60 s; else nothing.
  std::optional<Duration> base(TimePoint now, std::uint8_t key) const;
  // When the newest sample of this key came.
  std::optional<TimePoint> newest(std::uint8_t key) const { return base_[key].at; }

  // The probability that a round of a kind never seen loses more than `slack`:
  // (scale / (scale + slack))².
  double tail(Duration slack) const;
  void set_scale(Duration scale) { scale_ = scale; }

  // The rounds that had lost about as much before: those within `width` of `before`, or the kLeast
  // nearest ones where those are fewer. Without `before`: all.
  class Near;
  Near near(std::optional<Duration> before, Duration width) const;
  // A share of fewer rounds than this is mostly chance.
  static constexpr std::size_t kLeast = 4;

  struct Pair {
    std::int64_t before = 0;
    // Where `beyond`, only known to be such that before + after exceeds it.
    std::int64_t after = 0;
    // The part of `after` that is not the computation's.
    std::int64_t rest = 0;
    bool beyond = false;
  };
  std::size_t size() const { return size_; }
  // The i-th pair in no particular order, i < size().
  Pair pair(std::size_t i) const;

  // A clock has stepped: differences stay, and what contains the clock offset goes.
  void drop_bases();

 private:
  struct Base {
    std::optional<std::int64_t> value;
    // When its newest sample came.
    std::optional<TimePoint> at;
  };
  struct Entry {
    Sample sample;
    // sample.rest is as it came; else it is the difference to the base.
    bool fresh = false;
  };
  // The i-th newest, i < size().
  Entry& back(std::size_t i) { return ring_[(next_ + kRounds - 1 - i) % kRounds]; }
  // Turns samples of more than 10 s ago into differences.
  void age(TimePoint now);
  void freeze(Entry& entry);
  // Makes the base of this key anew.
  void renew(std::uint8_t key);

  std::array<Entry, kRounds> ring_{};
  std::size_t next_ = 0;
  std::size_t size_ = 0;
  // How many of the newest entries are fresh.
  std::size_t fresh_ = 0;
  std::array<Base, kKeys> base_{};
  Duration scale_ = std::chrono::milliseconds(20);
};

// Rounds of the law that are alike. All probabilities that one selection gives are about the same
// round; it holds no reference to what changes, except to the law itself, which must outlive it.
class ResidualLaw::Near {
 public:
  // The probability that a round loses at most `slack` from now on.
  Chance within(Duration slack) const;
  // The same without what its computation may lose.
  double rest_within(Duration slack) const;
  std::size_t size() const { return count_ + beyond_; }

 private:
  friend class ResidualLaw;
  // The weight that the smoothing tail has in this selection, in rounds.
  double weight_of_one() const;

  const ResidualLaw* law_ = nullptr;
  // Of rounds that were answered.
  std::array<std::int64_t, kRounds> after_;
  std::array<std::int64_t, kRounds> rest_;
  // Of rounds that were not: what they lost after exceeds this.
  std::array<std::int64_t, kRounds> more_;
  std::size_t count_ = 0;
  std::size_t beyond_ = 0;
};

}  // namespace interneuron::guard
