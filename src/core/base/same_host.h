// Whether two addresses are of the same host, whatever their ports.
//
// The core never looks inside an Address, with this one exception: a configuration names a relay by
// its address alone, since nobody knows the port that it will send from. The bytes are those of a
// sockaddr_in (16) or a sockaddr_in6 (28), in both of which the port is at bytes 2 and 3; addresses
// of any other size, as virtual networks make them up, have no port and must be equal. Pure.
#pragma once

#include <algorithm>
#include <cstddef>

#include "interneuron/address.h"

namespace interneuron {

inline bool is_same_host(Address a, Address b) {
  constexpr std::size_t kIpv4Bytes = 16;
  constexpr std::size_t kIpv6Bytes = 28;
  constexpr std::size_t kPortAt = 2;
  constexpr std::size_t kPortBytes = 2;
  if (a.size != b.size || a.size == 0) return false;
  if (a.size == kIpv4Bytes || a.size == kIpv6Bytes) {
    std::fill_n(a.raw.begin() + kPortAt, kPortBytes, std::byte{0});
    std::fill_n(b.raw.begin() + kPortAt, kPortBytes, std::byte{0});
  }
  return a == b;
}

}  // namespace interneuron
