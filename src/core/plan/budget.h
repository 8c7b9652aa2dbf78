// Deadline arithmetic for the application: how long a computation may take so that the round ends
// on time when nothing goes wrong. Pure.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "interneuron/policy.h"

namespace interneuron {

// What stays unplanned: turns of both loops, a slower run than usual. Chosen.
inline constexpr Duration kComputeReserve = std::chrono::milliseconds(5);

// D_N less the uplink of the best variant, the downlink of a result and kComputeReserve, over the
// link that brings the best variant soonest. Links without a measured rate or round trip are passed
// over; without any, nothing of the deadline can be promised and the answer is zero. Never
// negative.
Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes);

// Per variant of the offer that the plan holds: how long from now until the answer to it is back if
// the application on the other side took no time (the result's own bytes are not counted). By the
// links' queues, rates and round trips; the soonest copy counts. Nothing where no link of a variant
// has a measured rate and round trip.
std::array<std::optional<Duration>, kMaxVariants> forecast_answers(
    const Plan& plan, const Offer& offer, std::span<const LinkState> links);

}  // namespace interneuron
