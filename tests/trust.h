// Keys for the endpoints of tests: each host is known by a small number.
#pragma once

#include <algorithm>
#include <array>
#include <initializer_list>
#include <memory>

#include "interneuron/endpoint_options.h"
#include "interneuron/security.h"

namespace interneuron {

inline SecretKey secret_key(int number) {
  std::array<std::byte, kKeyBytes> bytes;
  bytes.fill(static_cast<std::byte>(number));
  return SecretKey(bytes);
}

inline PublicKey key_of_host(int host) { return public_key_of(secret_key(host)); }

// The options of this host, which trusts those. `life`: another one draws other ephemeral keys.
inline std::shared_ptr<const Security> security_of(int host, std::initializer_list<int> peers,
                                                   int life = 0) {
  auto security = std::make_shared<Security>();
  security->key = secret_key(host);
  for (const int peer : peers) security->peers.push_back({key_of_host(peer), {}});
  security->seed = secret_key(100 + 10 * host + life);
  security->unix_time_ns = std::int64_t{1'000'000'000} * (1 + life);
  return security;
}

}  // namespace interneuron
