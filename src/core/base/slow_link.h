// What a slow link may spend on its own upkeep. Above kSlow nothing here limits anything: feedback
// every 5 ms takes 0.3 Mbit/s, which is little of a fast link and all of a slow one. Header only.
#pragma once

#include <algorithm>
#include <cstddef>

#include "interneuron/units.h"

namespace interneuron {

// A link that is believed to carry less is slow. Feedback every 5 ms
// (src/core/peers/feedback_due.h) is a seventh of it.
inline constexpr DataRate kSlow{2'000'000};
// The share of a slow link that feedback takes at most. With it a link of 0.35 Mbit/s that carries
// results of 3 KB at 10 Hz, which are three quarters of it, is asked for less than it has
// (tests/lab/sim/slow_links_test.cc).
inline constexpr double kFeedbackShare = 0.05;
// Feedback is not held back for longer: an idle heartbeat (src/core/link/probe_schedule.h), which
// tells the same.
inline constexpr Duration kLongestFeedbackSpacing = std::chrono::milliseconds(300);

// Whether a rate was measured and is that of a slow link.
constexpr bool is_slow(DataRate rate) { return rate > DataRate{} && rate < kSlow; }

// How far apart feedback of so many bytes, with IP headers, leaves over a link of this rate at the
// least; zero: nothing holds it back.
constexpr Duration spacing_over(DataRate rate, std::size_t ip_bytes) {
  if (!is_slow(rate)) return Duration::zero();
  return std::min(rate.scaled(kFeedbackShare).transmit_time(ip_bytes), kLongestFeedbackSpacing);
}

}  // namespace interneuron
