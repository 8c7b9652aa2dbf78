// Time as values. Pure code receives `now`; it cannot read a clock, because these clocks have no
// now().
//
// Two hosts never share a clock, so their instants have different types: TimePoint (this host) and
// PeerTime (another host). The only bridge is elapsed_across(), whose result contains the unknown
// offset α = own clock - peer clock (docs/paper.md, "Clock offset"). Wire times may be any 64-bit
// value, so every subtraction and addition here wraps or saturates and is never undefined.
#pragma once

#include <chrono>
#include <cstdint>
#include <limits>

namespace interneuron {

using Duration = std::chrono::nanoseconds;

// CLOCK_MONOTONIC of this host, in nanoseconds. A label only: the one place that reads the clock is
// src/node/io/steady_clock.cc.
struct LocalClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<LocalClock>;
  static constexpr bool is_steady = true;
};
using TimePoint = LocalClock::time_point;

// CLOCK_MONOTONIC of some other host, in nanoseconds.
struct PeerClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<PeerClock>;
  static constexpr bool is_steady = true;
};
using PeerTime = PeerClock::time_point;

// a - b and a + b modulo 2^64: defined for any values that a peer may send.
constexpr std::int64_t wrapping_sub(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

constexpr std::int64_t wrapping_add(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}

// θ, the time elapsed since the peer's t0, by the own clock. It contains the clock offset α, so
// only differences of two θ mean anything (docs/paper.md, "Reference times").
constexpr Duration elapsed_across(PeerTime from, TimePoint to) {
  return Duration{wrapping_sub(to.time_since_epoch().count(), from.time_since_epoch().count())};
}

// The instant on this host's clock at which the elapsed time θ (which contains α) is reached for a
// round that began at t0 on the peer's clock.
constexpr TimePoint when_elapsed(PeerTime t0, Duration theta) {
  return TimePoint{Duration{wrapping_add(t0.time_since_epoch().count(), theta.count())}};
}

// An instant of this host as others see it: as a value of a peer's clock, for what goes on the wire
// and for a host that is the origin of the round itself.
constexpr PeerTime as_wire(TimePoint t) { return PeerTime{t.time_since_epoch()}; }

// t + d, saturating at the first and last instant; for deadlines computed from a peer's bytes.
constexpr TimePoint saturating_add(TimePoint t, Duration d) {
  std::int64_t out = 0;
  if (__builtin_add_overflow(t.time_since_epoch().count(), d.count(), &out)) {
    return d.count() > 0 ? TimePoint::max() : TimePoint::min();
  }
  return TimePoint{Duration{out}};
}

constexpr double to_seconds(Duration d) { return static_cast<double>(d.count()) / 1e9; }
constexpr double to_ms(Duration d) { return static_cast<double>(d.count()) / 1e6; }

constexpr Duration from_ms(double ms) { return Duration{static_cast<std::int64_t>(ms * 1e6)}; }

}  // namespace interneuron
