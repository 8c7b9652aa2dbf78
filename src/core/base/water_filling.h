// How a message is divided among several ways to one place so that its last part is there as soon
// as can be expected: each way gets what it brings until one common instant, as vessels that are
// joined fill to one level ("DEMS: Decoupled and Efficient Multipath Scheduling", MobiCom 2017).
//
// When a part is there is not certain, so which ways are used is decided by the probability that
// all parts are there in time: a way more only where that raises it, so that a slow one never does
// harm. Pure functions; no heap memory.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "interneuron/link.h"
#include "interneuron/units.h"

namespace interneuron {

// One way, as it is believed to be now.
struct Way {
  // Above zero.
  DataRate rate{};
  // Until a first byte that is handed over now is there, and how much that varies (standard
  // deviation).
  Duration delay{};
  Duration deviation{};
  // How much the rate is off (standard deviation), as a part of it.
  double rate_error = 0.1;
};

struct Division {
  // What each way carries, in the order given; those behind the number of ways are 0.
  std::array<std::size_t, kMaxLinks> bytes{};
  // When the last part should be there, from now.
  Duration time{};
  // The probability that all of them are there in time.
  double on_time = 0;
};

namespace water_filling {

inline double in_time(double seconds, double expected, double deviation) {
  const double sigma = std::max(deviation, 1e-6);
  return 0.5 * std::erfc((expected - seconds) / (sigma * std::sqrt(2.0)));
}

}  // namespace water_filling

// Divides `bytes` among at most kMaxLinks ways, of which there is at least one.
inline Division divide(std::span<const Way> ways, std::size_t bytes, Duration deadline) {
  namespace wf = water_filling;
  std::array<std::size_t, kMaxLinks> order{};
  const std::size_t count = std::min(ways.size(), kMaxLinks);
  for (std::size_t i = 0; i < count; ++i) order[i] = i;
  // In bytes per second.
  const auto rate_of_way = [](const Way& way) {
    return static_cast<double>(way.rate.bits_per_second) / 8;
  };
  // The time of all the bytes over one way: the best way alone is the first choice.
  const auto alone = [&](std::size_t i) {
    return to_seconds(ways[i].delay) + static_cast<double>(bytes) / rate_of_way(ways[i]);
  };
  std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count),
            [&](std::size_t a, std::size_t b) { return alone(a) < alone(b); });
  Division best;
  double rates = 0;
  double weighted = 0;
  for (std::size_t used = 1; used <= count; ++used) {
    const Way& added = ways[order[used - 1]];
    rates += rate_of_way(added);
    weighted += rate_of_way(added) * to_seconds(added.delay);
    const double level = (static_cast<double>(bytes) + weighted) / rates;
    double on_time = 1;
    bool all_carry = true;
    for (std::size_t i = 0; i < used; ++i) {
      const Way& way = ways[order[i]];
      const double air = level - to_seconds(way.delay);
      all_carry = all_carry && air > 0;
      on_time *= wf::in_time(to_seconds(deadline), level,
                             std::hypot(to_seconds(way.deviation), way.rate_error * air));
    }
    if (!all_carry || (used > 1 && on_time <= best.on_time)) continue;
    best.on_time = on_time;
    best.time = Duration{static_cast<std::int64_t>(level * 1e9)};
    best.bytes = {};
    std::size_t left = bytes;
    for (std::size_t i = used; i-- > 0;) {
      const Way& way = ways[order[i]];
      const auto part =
          static_cast<std::size_t>((level - to_seconds(way.delay)) * rate_of_way(way));
      best.bytes[order[i]] = i == 0 ? left : std::min(left, part);
      left -= best.bytes[order[i]];
    }
  }
  return best;
}

}  // namespace interneuron
