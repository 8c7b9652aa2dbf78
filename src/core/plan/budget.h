// Deadline arithmetic for the application: how long a computation may take so that the round ends
// on time when nothing goes wrong. Pure.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "interneuron/policy.h"

namespace interneuron::plan {

// The part of the deadline that stays unplanned, for the turns of both event loops and for a run
// that is slower than usual. No measurement behind this value: it only has to be larger than a turn
// of a busy loop.
inline constexpr Duration kComputeReserve = std::chrono::milliseconds(5);

// How long a computation may take: the end-to-end deadline less the uplink of the best variant, the
// downlink of a result and kComputeReserve, over the link that brings both soonest. Links whose
// rate or round trip is not measured are passed over; when all are, nothing of the deadline can be
// promised and the answer is zero. Never negative.
Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes);

// How long a small message that leaves now is on its way over the link that brings it soonest: half
// of the smallest round trip of late and what waits on the link now, so that a queue that grows
// counts at once and only once. Zero where no link is measured.
Duration soonest_way(std::span<const LinkState> links);

// For each variant of the offer: how long from now until the answer to it is back if the plan is
// carried out and the application on the other side takes no time. Follows from the links' queues,
// rates and smallest round trips (half of the median in its place would count a queue twice); the
// soonest copy of a variant counts, and the result's own bytes do not. Nothing for a variant that
// the plan does not hold or whose links are not measured.
std::array<std::optional<Duration>, kMaxVariants> forecast_answers(
    const Plan& plan, const Offer& offer, std::span<const LinkState> links);

}  // namespace interneuron::plan
