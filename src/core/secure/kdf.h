// Keys from keys, by HKDF with SHA-256 (RFC 5869) in the form that Noise gives it, and codes of
// bytes.
#pragma once

#include <array>
#include <string_view>

#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

// HMAC-SHA256 (RFC 2104) of the parts, one after the other.
SecretKey hmac(const SecretKey& key, ByteView first, ByteView second = {});
// The first three outputs of HKDF; who needs fewer ignores the last.
std::array<SecretKey, 3> derive(const SecretKey& chaining, ByteView input);

inline constexpr std::size_t kMacBytes = 16;
using Mac = std::array<std::byte, kMacBytes>;
// A code over these bytes, keyed BLAKE2b (RFC 7693); and whether `mac` is that, in constant time.
Mac mac_of(const SecretKey& key, ByteView bytes);
bool is_mac(ByteView mac, const SecretKey& key, ByteView bytes);

}  // namespace interneuron::crypto
