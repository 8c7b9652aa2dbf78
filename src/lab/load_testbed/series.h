// All runs of `bench load --testbed`, one after the other.
#pragma once

#include <vector>

#include "interneuron/node_options.h"
#include "lab/load/figures.h"

namespace interneuron::cli {

// Which loads the groups have on the testbed that let loads be chosen, unless they are: those at
// which a transport shows what it does, since each run takes as long as it lasts.
inline constexpr double kTestbedLoads[] = {1.05, 1.5};

// Runs what this machine can and tells on stderr what is left out and why, how far it is, and what
// makes a row doubtful. A SignalWatch must be alive. Throws Failure (77) when nothing is left, and
// what run_on_testbed() throws.
// `datagrams`: as in Transport.
std::vector<load::Row> run_series(const std::vector<load::Scenario>& scenarios,
                                  TransportKind datagrams);

}  // namespace interneuron::cli
