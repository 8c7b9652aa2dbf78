// What the programs of a host keep of their peers, as lines of the live view. Pure; no errors.
#pragma once

#include <vector>

#include "app/watch/row.h"
#include "app/watch/screen.h"

namespace interneuron::watch {

// A line for each program that has peers, with the longest stall of its loop, and one for each peer
// that holds something or that a limit has struck: those that were struck most often first, at most
// kPeersShown of them. Nothing where there is no such program.
inline constexpr std::size_t kPeersShown = 8;
std::vector<Line> ledger_lines(const std::vector<LiveProgram>& programs);

}  // namespace interneuron::watch
