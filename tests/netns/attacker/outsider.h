// Everything that somebody without a key can send at a road and at a vehicle whose packets are
// encrypted. He is on the way between the two, so that he sees and can repeat what they send, and
// forges every address; but he holds nothing back.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace interneuron::attacker {

struct OutsiderOptions {
  // The NICs towards the road and towards the vehicle, one of each for every link.
  std::vector<std::string> road_nics;
  std::vector<std::string> vehicle_nics;
  // A capture of a former life of the vehicle; empty: there is none.
  std::string old;
  std::string road_key;
  // A network of 65,536 addresses to which nothing may be sent.
  std::string spoofed = "10.99.0.0";
  double packets = 1e6;
  double pps = 20'000;
  std::uint64_t seed = 1;
};

// Sends so many and prints one line of JSON, with what was sent of each kind to whom. Returns the
// exit code: 1 when it saw nobody to attack. Throws std::runtime_error.
int run_outsider(const OutsiderOptions& options);

}  // namespace interneuron::attacker
