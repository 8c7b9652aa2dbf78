// The runs of `bench peers --quick`: what there is to see in less than 25 minutes.
//
// Everything that is compared takes hours. Here the peers meet in messages of 128 KiB with a
// deadline of 100 ms under one condition after the other; what becomes of other sizes and deadlines
// is shown for a few of them, with losses. Pure; thread-safe; no errors.
#pragma once

#include <cstdint>
#include <vector>

#include "lab/peers_testbed/scenario.h"

namespace interneuron::peers {

// By scenario, then by size, then by peer, then by deadline.
std::vector<Run> quick_runs(std::uint64_t seed);

}  // namespace interneuron::peers
