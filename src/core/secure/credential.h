// What a fleet authority signs, so that a roadside unit need not list every vehicle: who has a key
// (Credential), and whose credentials count no more (Revocations). Ed25519 (RFC 8032).
//
// Both are read from bytes that anybody may have made; nothing of them is used before the signature
// of an authority was checked that the reader trusts. Pure; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

// The bytes of a signed credential.
Bytes sign_credential(const Credential& credential, const SecretKey& authority);
// Whether one of these authorities has signed it; the credential if so, whatever its times are.
std::optional<Credential> read_credential(ByteView bytes, std::span<const PublicKey> authorities);
// Whether it holds at this time.
bool is_valid_at(const Credential& credential, std::int64_t unix_s);

// The same for lists.
Bytes sign_revocations(const Revocations& list, const SecretKey& authority);
std::optional<Revocations> read_revocations(ByteView bytes, std::span<const PublicKey> authorities);
bool is_revoked(const Revocations& list, const PublicKey& key);

// The public half of an authority's private key.
PublicKey authority_key_of(const SecretKey& secret);

}  // namespace interneuron::crypto
