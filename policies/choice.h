// What the built-in policies share: the fastest links that are fit for a message, and what is sent
// over them. Against the public headers alone; a policy of your own may copy what it needs.
#pragma once

#include <limits>

#include "interneuron/policy.h"
#include "interneuron/requirement.h"

namespace interneuron::policies {

inline constexpr std::size_t kAllLinks = std::numeric_limits<std::size_t>::max();

// The links that meet the floor, at most so many, fastest first.
Links fastest(std::span<const LinkState> links, DataRate floor, std::size_t count);

// One variant over each of these links.
Plan send_over(std::span<const LinkState> chosen, std::uint8_t variant);

// A variant over the fastest links that can carry it, at most so many; where none can, over the
// fastest all the same, reported.
Plan over_fastest(const Offer& offer, std::span<const LinkState> links, std::uint8_t variant,
                  std::size_t count);

std::uint8_t smallest_variant(const Offer& offer);

// Holds what is not the best that was planned, unless it was sent degraded.
Merge hold_for_better(const Arrival& arrival);

}  // namespace interneuron::policies
