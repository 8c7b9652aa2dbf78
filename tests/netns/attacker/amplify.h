// Packets in the name of victims, to make a roadside unit send them more than the attacker sends:
// it learns the unit's session from its own address and then forges the echo that is to prove that
// a victim wants what it gets. With keys it is a host that the unit trusts, and seals what it
// forges.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/netns/attacker/confined.h"

namespace interneuron::attacker {

struct AmplifyOptions {
  // As many NICs as addresses of the unit, each reached over the NIC of the same place.
  std::vector<std::string> nics;
  std::vector<std::string> roads;
  // The victims: address 1 + i of this network for the way i of forging, over the first link; 101 +
  // i over all links.
  std::string victims = "10.97.0.0";
  double seconds = 120;
  std::uint64_t seed = 1;
  // Keys that the unit trusts, one for each victim, and the unit's own; empty: in the clear.
  std::vector<std::string> keys;
  std::string road_key;
};

// Forges for so long and prints one line of JSON, with the bytes sent in the name of each victim.
// Returns the exit code: 1 when the unit's session could not be learnt. Throws std::runtime_error.
int run_amplify(const AmplifyOptions& options);

struct StampOptions {
  std::string nic;
  // In whose name, and to whom.
  Place from;
  Place to;
};
// One forged STAMP request. Returns the exit code. Throws std::runtime_error.
int run_stamp(const StampOptions& options);

}  // namespace interneuron::attacker
