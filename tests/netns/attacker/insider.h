// What an admitted peer may do to harm others, one attack at a time: each is a function that gives
// an AdmittedPeer more to send whenever nothing waits, so that the rate is the peer's bound.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "tests/netns/attacker/admitted_peer.h"
#include "tests/netns/attacker/confined.h"

namespace interneuron::attacker {

struct InsiderOptions {
  std::string nic;
  Place road;
  // One of insider_attacks().
  std::string attack;
  double seconds = 60;
  double kbit = 1000;
  // The session of a vehicle, for the attack that speaks in its name.
  std::uint32_t victim_session = 0;
  std::uint64_t seed = 1;
  // Its own key and the road's; empty: in the clear.
  std::string key;
  std::string road_key;
};

std::vector<std::string> insider_attacks();

// Joins, attacks for so long and prints one line of JSON. Returns the exit code: 1 when it was not
// admitted. Throws std::runtime_error.
int run_insider(const InsiderOptions& options);

}  // namespace interneuron::attacker
