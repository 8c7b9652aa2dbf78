// Profiles and options that the tests in virtual time share.
#pragma once

#include <gtest/gtest.h>

#include "lab/sim/offload.h"

namespace interneuron::sim {

using namespace std::chrono_literals;

// The sanitizers' builds are ten times slower: they look for other faults than the figures, on
// shorter runs.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

inline emu::LinkProfile profile(const char* name) {
  auto p = emu::built_in_profile(name);
  EXPECT_TRUE(p) << name;
  return *p;
}

using emu::constant_link;

// The demo's drive: 5G and 4G, 300 rounds at 10 Hz, 130 ms.
inline OffloadOptions drive(std::uint64_t seed, std::uint32_t rounds = 300) {
  OffloadOptions o;
  o.seed = seed;
  o.rounds = rounds;
  o.profiles = {profile("5g"), profile("4g")};
  return o;
}

}  // namespace interneuron::sim
