// The checks of one network card (NIC), for judge() of judge.h. Pure; thread-safe.
#pragma once

#include <vector>

#include "app/doctor/judge.h"

namespace interneuron::doctor {

// Appends the findings of one NIC.
void judge_nic(const io::HostFacts& host, const io::NicHostFacts& nic,
               std::vector<Finding>& findings);

// The network of an address, "192.168.8.0/24"; and whether two addresses' networks overlap.
std::string subnet_text(const io::SourceFacts& source);
bool overlap(const io::SourceFacts& a, const io::SourceFacts& b);

}  // namespace interneuron::doctor
