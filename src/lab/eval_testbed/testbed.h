// The experiments of `interneuron eval --testbed`.
#pragma once

#include "lab/eval/experiments/experiment.h"

namespace interneuron::cli {

// Runs table-erdos with the programs `vehicle` and `road` on real sockets over emulated links, then
// the same seeds in virtual time with the run times that this machine had, and fills in the tables,
// series and notes of `document`. Takes as long as the rounds take. Throws Failure, and
// netns::TestbedError where namespaces are forbidden.
void run_table_erdos_on_testbed(const experiments::Request& request,
                                experiments::Document& document);

}  // namespace interneuron::cli
