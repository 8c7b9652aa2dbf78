// The running part of `interneuron doctor --nat-timeout`: a probe::SilenceTest per network card
// (NIC), all at once, a socket per flow.
#pragma once

#include <string>
#include <vector>

#include "app/doctor/judge_nat.h"
#include "host/io/host_facts.h"

namespace interneuron::cli::doctor {

// Takes some seconds more than `limit`; SIGINT and the like end it before. Says on stderr how long
// it takes. Over the usable NICs that `facts` says the peer, its target, is routed through; one
// whose sockets cannot be opened, or that goes away meanwhile, is cut short. Throws IoError only
// when the NICs cannot be watched.
std::vector<NatTimeout> measure_nat_timeouts(const io::HostFacts& facts, probe::Silence limit);

}  // namespace interneuron::cli::doctor
