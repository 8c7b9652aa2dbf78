// Upper bounds of what any system could have done in a round: they know the delays that the links
// will have, which no system does. Pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include "interneuron/time.h"
#include "lab/emu/link.h"

namespace interneuron::sim {

// What a message of so many bytes is on a link: with the round's header and the headers of each
// packet down to IPv4's.
std::size_t bytes_on_wire(std::size_t message_bytes);

// Whether some combination of input, links and level answers a round begun at `t0` by its deadline:
// an input of `smallest_bytes` over whichever link brings it first, a computation of
// `fastest_compute`, and the result over whichever link is then quickest. Losses are not
// considered. `processes` are the delay processes of `profiles`, asked at growing instants; none of
// them may have passed `t0`.
bool clairvoyant_feasible(const std::vector<emu::LinkProfile>& profiles,
                          const std::vector<emu::DelayProcess*>& processes, Duration t0,
                          Duration deadline, std::size_t smallest_bytes, std::size_t result_bytes,
                          Duration fastest_compute);

}  // namespace interneuron::sim
