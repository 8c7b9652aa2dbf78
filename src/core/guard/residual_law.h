// What rounds lose against their reference: per round the pair (before, after) the computation
// began, and the probability that a round which has lost so much before loses at most so much
// after. Pairs, because delays come one to a round: a round that already lost time seldom loses
// more.
//
// "After" is what the computation took beyond what was expected of it, plus what the rest of the
// round took beyond its base. The rest may contain the clock offset: it is kept as it is for 10 s,
// with its median as the base, and as the difference to that base afterwards. So a constant offset
// cancels in integers, a drifting one within 10 s, and a clock step costs the bases, not the law.
//
// The law is the empirical one of the last kRounds rounds; no shape is assumed. What was never seen
// is allowed for by a heavy tail that weighs one round among all of them. Pure; thread-compatible;
// no allocation.
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
  // The share of alike rounds, if one more had been late or on time: what is known of it.
  double least = 0;
  double most = 0;
  double hedged = 0;  // the share with the tail of what was never seen
  friend bool operator==(const Chance&, const Chance&) = default;
};
inline Chance chance(double on_time, double rounds, double hedged) {
  return {on_time / (rounds + 1), (on_time + 1) / (rounds + 1), hedged};
}

class ResidualLaw {
 public:
  static constexpr std::size_t kRounds = 512;  // chosen: 51 s at 10 rounds per second
  static constexpr std::size_t kFresh = 128;   // rounds that a base is the median of, at most
  static constexpr std::size_t kKeys = 16;     // bases; 8 variants, degraded or not

  struct Sample {
    RoundId round{};
    TimePoint at{};
    std::uint8_t key = 0;  // which base
    Duration before{};
    // Its last computation, and by how much it exceeded what was expected of it.
    struct Run {
      std::size_t level = 0;
      Duration median{};  // of the level
      Duration took{};
    } run;
    Duration computed{};
    // kKnown: what the rest took, offset included. kBeyond: nothing is known but that before +
    // after of this round exceeds it (never answered).
    Duration rest{};
    enum class Kind : std::uint8_t { kKnown, kBeyond } kind = Kind::kKnown;
  };
  // A sample of the same round replaces what was known of it.
  void add(TimePoint now, const Sample& sample);

  // What is expected of computations has changed: each of the last 10 s is judged by what was
  // expected when it ran or is now, whichever explains it better. So a node that becomes slower (or
  // fast again) is learnt once, not remembered as a chain of accidents.
  void reconsider(const Speed& speed);

  // The median of the rest over the last 10 s, offset included; the last one there was for 60 s.
  std::optional<Duration> base(TimePoint now, std::uint8_t key) const;
  // When the newest sample of this key came.
  std::optional<TimePoint> newest(std::uint8_t key) const { return base_[key].at; }

  // Scale of the smoothing tail T(s) = (scale / (scale + s))²: how much later than anything else a
  // round may be; see tail().
  void set_scale(Duration scale) { scale_ = scale; }
  double tail(Duration slack) const;

  // The rounds that had lost about as much before: those within `width`, or the kLeast nearest
  // where those are fewer. Nothing for `before`: all.
  class Near;
  Near near(std::optional<Duration> before, Duration width) const;
  static constexpr std::size_t kLeast = 4;  // chosen

  struct Pair {
    std::int64_t before = 0;
    std::int64_t after = 0;  // kBeyond: before + after exceeds this
    std::int64_t rest = 0;   // the part of `after` that is not the computation's
    bool beyond = false;
  };
  std::size_t size() const { return size_; }
  Pair pair(std::size_t i) const;  // i < size(), in no order

  // A clock stepped: differences stay, what contains the offset goes.
  void drop_bases();

 private:
  struct Base {
    std::optional<std::int64_t> value;
    std::optional<TimePoint> at;  // of the newest sample
  };
  struct Entry {
    Sample sample;
    bool fresh = false;  // sample.rest is as it came, else the difference to the base
  };
  Entry& back(std::size_t i) { return ring_[(next_ + kRounds - 1 - i) % kRounds]; }
  void age(TimePoint now);
  void freeze(Entry& entry);
  void renew(std::uint8_t key);

  std::array<Entry, kRounds> ring_{};
  std::size_t next_ = 0;
  std::size_t size_ = 0;
  std::size_t fresh_ = 0;  // of the newest entries
  std::array<Base, kKeys> base_{};
  Duration scale_ = std::chrono::milliseconds(20);
};

// A selection of rounds; the probabilities that it gives are all about the same round.
class ResidualLaw::Near {
 public:
  // That a round loses at most `slack` from now on.
  Chance within(Duration slack) const;
  // The same without what its computation may lose.
  double rest_within(Duration slack) const;
  std::size_t size() const { return count_ + beyond_; }

 private:
  friend class ResidualLaw;
  // The smoothing tail's, in this selection.
  double weight_of_one() const;

  const ResidualLaw* law_ = nullptr;
  std::array<std::int64_t, kRounds> after_;
  std::array<std::int64_t, kRounds> rest_;
  std::array<std::int64_t, kRounds> more_;  // kBeyond: after exceeds this
  std::size_t count_ = 0;
  std::size_t beyond_ = 0;
};

}  // namespace interneuron::guard
