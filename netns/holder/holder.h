// The holder: the process that makes the namespaces of a testbed, keeps them alive by holding their
// file descriptors, and drives the links by either back end until it gets SIGTERM. One per testbed.
// It reads bytes of others: requests on its control socket (netns/state/control.h says who may send
// them) and, as the emulator, the frames of the programs inside.
#pragma once

#include "netns/state/options.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// Forks the holder and returns when it is ready and has written its state file, which `state` then
// holds. Before the call `state` has name, seed, links, nat, detached and file. The caller holds
// the lock of the runtime directory. Throws TestbedError with what the holder could not do, or
// after 20 s without an answer; in either case the holder ends and the kernel frees all it made.
void start_holder(const TestbedOptions& options, State& state);

}  // namespace interneuron::netns
