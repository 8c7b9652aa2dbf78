// Keys for endpoints in virtual time, and for those of tests: each host is known by a number. The
// same numbers give the same keys, so they protect nothing. Pure; thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "interneuron/security.h"

namespace interneuron::sim {

inline SecretKey secret_key(int number) {
  const auto bits = static_cast<std::uint32_t>(number);
  std::array<std::byte, kKeyBytes> bytes;
  bytes.fill(static_cast<std::byte>(bits));
  for (std::size_t i = 1; i < sizeof bits; ++i) bytes[i] ^= static_cast<std::byte>(bits >> 8 * i);
  return SecretKey(bytes);
}

inline PublicKey key_of_host(int host) { return public_key_of(secret_key(host)); }

// The options of this host, which trusts those. `life`, below 16: another one draws other ephemeral
// keys.
inline std::shared_ptr<const Security> security_of(int host, const std::vector<int>& peers,
                                                   int life = 0) {
  constexpr int kSeeds = 1 << 30;
  auto security = std::make_shared<Security>();
  security->key = secret_key(host);
  for (const int peer : peers) security->peers.push_back({key_of_host(peer), {}});
  security->seed = secret_key(kSeeds + 16 * host + life);
  security->unix_time_ns = std::int64_t{1'000'000'000} * (1 + life);
  return security;
}

}  // namespace interneuron::sim
