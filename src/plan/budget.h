// Deadline arithmetic for the application: how long a computation may take so that the round ends
// on time when nothing goes wrong. Pure.
#pragma once

#include <span>

#include "interneuron/link.h"

namespace interneuron {

// D_N less the uplink of the best variant, the downlink of a result and a reserve of 5 ms, over the
// link that brings the best variant soonest. Links without a measured rate or round trip are passed
// over; without any, nothing of the deadline can be promised and the answer is zero. Never
// negative.
Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes);

}  // namespace interneuron
