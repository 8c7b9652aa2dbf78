// What a fleet authority signs, so that a roadside unit need not list every vehicle: who has a key
// (Credential), and whose credentials count no more (Revocations). Ed25519 (RFC 8032).
//
// Both are read from bytes that anybody may have made; nothing of them is used before the signature
// of an authority was checked that the reader trusts. Pure; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

// The bytes of a signed credential.
Bytes sign_credential(const Credential& credential, const SecretKey& authority);
// Whether one of these authorities has signed it; the credential if so, whatever its times are.
std::optional<Credential> read_credential(ByteView bytes, std::span<const PublicKey> authorities);
// What it says, whoever has signed it: for its owner, who need not know the authority.
std::optional<Credential> parse_credential(ByteView bytes);
// Whether it holds at this time.
bool is_valid_at(const Credential& credential, std::int64_t unix_s);

// The same for lists.
Bytes sign_revocations(const Revocations& list, const SecretKey& authority);
std::optional<Revocations> read_revocations(ByteView bytes, std::span<const PublicKey> authorities);
bool is_revoked(const Revocations& list, const PublicKey& key);

// Credentials and lists as people copy them: one line of base64 (RFC 4648 §4). Nothing where a text
// is not exactly that.
std::string to_text(ByteView bytes);
std::optional<Bytes> parse_text(std::string_view text);

// The public half of an authority's private key.
PublicKey authority_key_of(const SecretKey& secret);

}  // namespace interneuron::crypto
