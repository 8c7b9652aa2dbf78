// What those policies share that weigh times against the deadline: how long it takes to send a
// message, to compute on it and to have the answer back, and which way to do so is best. Written
// against the public headers alone. Pure; allocates nothing.
#pragma once

#include <optional>

#include "interneuron/policy.h"

namespace interneuron::policies {

// The part of the time left that stays unplanned, for the turns of both event loops and for a
// computation that is slower than usual. No measurement behind this value: it only has to be larger
// than a turn of a busy loop. The same value as kComputeReserve of src/core/plan/budget.h.
inline constexpr Duration kOffloadReserve = std::chrono::milliseconds(5);

// How long until the answer is back when `bytes` leave now over this link and are computed on for
// `compute`. Duration::max() while the link is not measured.
Duration round_time(const LinkState& link, std::size_t bytes, Duration compute);

// Whether something that takes `time` fits into `time_left` less kOffloadReserve. Everything does
// while the time left is not known (Duration::max()).
bool in_time(Duration time_left, Duration time);

// One way to have a message computed on elsewhere: which variant goes over which link.
struct Offload {
  std::uint8_t variant = 0;
  LinkState link;
  // Expected quality of the result. While the levels are not known it only ranks the variants: 0
  // for the best one, -1 for the next, …
  double quality = 0;
  // round_time() of it.
  Duration time{};
};

// Picks among all ways that are in time, over links that can carry the variant, the one with the
// highest quality, of equals the one that takes least time. Where the guard says which variant is
// to be sent (Guidance), that one alone. Nothing when no measured link is in time.
std::optional<Offload> best_offload(const Offer& offer, std::span<const LinkState> links,
                                    const Guidance& guidance);

}  // namespace interneuron::policies
