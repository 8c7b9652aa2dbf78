// What the policies share that weigh times against the deadline: how long it takes to send
// something, to compute on it and to have the answer back, and which way to do so is best. Against
// the public headers alone.
#pragma once

#include <optional>

#include "interneuron/policy.h"

namespace interneuron::policies {

// What stays unplanned: turns of both loops, a slower run than usual. Chosen, as kComputeReserve.
inline constexpr Duration kOffloadReserve = std::chrono::milliseconds(5);

// Until the answer is back when `bytes` leave now over this link and are computed on for `compute`.
// max() while the link is not measured.
Duration round_time(const LinkState& link, std::size_t bytes, Duration compute);

// Whether something that takes `time` fits, with the reserve; anything does while time_left is not
// known.
bool in_time(Duration time_left, Duration time);

// One way to have a message computed on elsewhere.
struct Offload {
  std::uint8_t variant = 0;
  LinkState link;
  double quality =
      0;  // expected; while the levels are not known: 0 for the best variant, then -1, …
  Duration time{};  // round_time()
};

// The way with the highest quality of those that are in time, over links that can carry the
// variant; of equals the one that takes least time. Degraded: of the smallest variant only. Nothing
// when no measured link is in time.
std::optional<Offload> best_offload(const Offer& offer, std::span<const LinkState> links,
                                    const Guidance& guidance);

}  // namespace interneuron::policies
