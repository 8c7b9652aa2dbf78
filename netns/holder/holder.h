// The holder: the process that makes the namespaces, keeps them, and is the emulator.
#pragma once

#include "netns/state/options.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// Forks it and returns when it is ready and its state file is written. `state` has name, seed,
// links, detached and file. The caller holds the lock of the runtime directory. Throws TestbedError
// with what the holder could not do; then nothing is left.
void start_holder(const TestbedOptions& options, State& state);

}  // namespace interneuron::netns
