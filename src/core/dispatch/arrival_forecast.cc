#include "core/dispatch/routes.h"

#include <algorithm>

#include "interneuron/sizes.h"

namespace interneuron::dispatch {
namespace {

// Stands for a time beyond any deadline, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(2);

}  // namespace

std::optional<Duration> arrival_forecast(const LinkState& link, std::size_t ahead,
                                         std::size_t bytes) {
  if (link.rtt_min <= Duration::zero()) return std::nullopt;
  Duration air{};
  if (link.rate.bits_per_second > 0) {
    air = link.usable_rate().transmit_time(wire_size(ahead) + wire_size(bytes));
  }
  return link.rtt_min / 2 + link.queue_up + std::min<Duration>(air, kNever);
}

bool cannot_arrive(const LinkState& link, std::optional<Duration> expected, Duration deadline) {
  return expected && *expected > deadline + link.jitter;
}

}  // namespace interneuron::dispatch
