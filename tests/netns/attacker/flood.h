// A flood of peers that want to join: most from addresses that are not the attacker's, some from a
// network that is, in whose name it answers what comes, tokens too. Where the road has a key, they
// ask for handshakes, and what is answered are cookies.
#pragma once

#include <cstdint>
#include <string>

#include "tests/netns/attacker/confined.h"

namespace interneuron::attacker {

struct FloodOptions {
  std::string nic;
  Place road;
  // The networks of 65,536 addresses from which it sends; the second must be routed to this host
  // and be local there.
  std::string spoofed = "10.99.0.0";
  std::string owned = "10.98.0.0";
  double spoofed_pps = 50'000;
  double owned_pps = 1'000;
  double seconds = 60;
  std::uint64_t seed = 1;
  // The road's public key; empty: in the clear.
  std::string road_key;
};

// Floods for so long and prints one line of JSON. Returns the exit code. Throws std::runtime_error.
int run_flood(const FloodOptions& options);

}  // namespace interneuron::attacker
