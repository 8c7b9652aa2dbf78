// Keys from keys: HKDF with SHA-256 (RFC 5869), in the form that Noise gives it.
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

}  // namespace interneuron::crypto
