// Measures for `interneuron doctor --nat-timeout` how long address translations keep silent flows
// open: runs a probe::SilenceTest for each network card (NIC), all at the same time, with a socket
// per flow. Takes the calling thread.
#pragma once

#include <string>
#include <vector>

#include "app/doctor/judge_nat.h"
#include "node/monitor/host_facts.h"

namespace interneuron::doctor {

// Measures over the usable NICs through which the target of `facts` is routed. Takes some seconds
// more than `limit` and says on stderr how long; SIGINT, SIGTERM and SIGHUP end it earlier. A NIC
// whose sockets cannot be opened, or that goes away, is reported as cut short. Throws IoError only
// when the NICs cannot be watched.
std::vector<NatTimeout> measure_nat_timeouts(const io::HostFacts& facts, probe::Silence limit);

}  // namespace interneuron::doctor
