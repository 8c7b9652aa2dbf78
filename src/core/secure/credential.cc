#include "core/secure/credential.h"

#include <sodium.h>

#include <algorithm>
#include <array>
#include <cassert>

#include "core/secure/bytes.h"
#include "core/wire/bytes.h"

namespace interneuron {

static_assert(kSignatureBytes == crypto_sign_ed25519_BYTES);
static_assert(kKeyBytes == crypto_sign_ed25519_PUBLICKEYBYTES);
static_assert(kKeyBytes == crypto_sign_ed25519_SEEDBYTES);

namespace crypto {
namespace {

// What is signed begins with what it is, so that a signature of one thing is none of another.
constexpr std::string_view kCredentialLabel = "interneuron credential 1";
constexpr std::string_view kRevocationsLabel = "interneuron revocations 1";
constexpr std::size_t kRevocationsFixed = 8 + 4;

Bytes labelled(std::string_view label, ByteView bytes) {
  const ByteView name = bytes_of(label);
  Bytes out(name.begin(), name.end());
  out.insert(out.end(), bytes.begin(), bytes.end());
  return out;
}

void append_signature(Bytes& bytes, std::string_view label, const SecretKey& authority) {
  std::array<std::byte, crypto_sign_ed25519_PUBLICKEYBYTES> open{};
  std::array<std::byte, crypto_sign_ed25519_SECRETKEYBYTES> secret{};
  crypto_sign_ed25519_seed_keypair(target(open), target(secret), raw(authority.bytes()));
  std::array<std::byte, kSignatureBytes> signature{};
  const Bytes text = labelled(label, bytes);
  crypto_sign_ed25519_detached(target(signature), nullptr, raw(text), text.size(), raw(secret));
  sodium_memzero(secret.data(), secret.size());
  bytes.insert(bytes.end(), signature.begin(), signature.end());
}

bool is_signed(ByteView bytes, std::string_view label, std::span<const PublicKey> authorities) {
  if (bytes.size() < kSignatureBytes) return false;
  const Bytes text = labelled(label, bytes.first(bytes.size() - kSignatureBytes));
  return std::ranges::any_of(authorities, [&](const PublicKey& authority) {
    return crypto_sign_ed25519_verify_detached(raw(bytes.last(kSignatureBytes)), raw(text),
                                               text.size(), raw(authority)) == 0;
  });
}

}  // namespace

PublicKey authority_key_of(const SecretKey& secret) {
  PublicKey open{};
  std::array<std::byte, crypto_sign_ed25519_SECRETKEYBYTES> both{};
  crypto_sign_ed25519_seed_keypair(target(open), target(both), raw(secret.bytes()));
  sodium_memzero(both.data(), both.size());
  return open;
}

Bytes sign_credential(const Credential& credential, const SecretKey& authority) {
  Bytes out(kCredentialBytes - kSignatureBytes);
  wire::Writer w(out);
  w.put_bytes(credential.key);
  w.put(static_cast<std::uint8_t>(credential.role));
  std::array<std::byte, kNodeNameBytes> name{};
  std::ranges::copy(bytes_of(std::string_view(credential.node).substr(0, kNodeNameBytes)),
                    name.begin());
  w.put_bytes(name);
  w.put(credential.not_before_s);
  w.put(credential.not_after_s);
  assert(w.ok() && w.size() == out.size());
  append_signature(out, kCredentialLabel, authority);
  return out;
}

std::optional<Credential> read_credential(ByteView bytes, std::span<const PublicKey> authorities) {
  if (!is_signed(bytes, kCredentialLabel, authorities)) return std::nullopt;
  return parse_credential(bytes);
}

std::optional<Credential> parse_credential(ByteView bytes) {
  if (bytes.size() != kCredentialBytes) return std::nullopt;
  Credential out;
  std::ranges::copy(bytes.first(kKeyBytes), out.key.begin());
  wire::Reader r(bytes.subspan(kKeyBytes));
  const auto role = r.get<std::uint8_t>();
  for (std::size_t i = 0; i < kNodeNameBytes; ++i) {
    const auto c = r.get<std::uint8_t>();
    if (c != 0) out.node.push_back(static_cast<char>(c));
  }
  out.not_before_s = r.get<std::int64_t>();
  out.not_after_s = r.get<std::int64_t>();
  if (!r.ok() || role > static_cast<std::uint8_t>(NodeRole::kRoadside)) return std::nullopt;
  out.role = static_cast<NodeRole>(role);
  return out;
}

bool is_valid_at(const Credential& credential, std::int64_t unix_s) {
  return unix_s >= credential.not_before_s && unix_s < credential.not_after_s;
}

Bytes sign_revocations(const Revocations& list, const SecretKey& authority) {
  Bytes out(kRevocationsFixed + list.keys.size() * kKeyBytes);
  wire::Writer w(out);
  w.put(list.issued_s);
  w.put(static_cast<std::uint32_t>(list.keys.size()));
  for (const PublicKey& key : list.keys) w.put_bytes(key);
  assert(w.ok());
  append_signature(out, kRevocationsLabel, authority);
  return out;
}

std::optional<Revocations> read_revocations(ByteView bytes,
                                            std::span<const PublicKey> authorities) {
  if (bytes.size() > kMaxRevocationsBytes || !is_signed(bytes, kRevocationsLabel, authorities)) {
    return std::nullopt;
  }
  wire::Reader r(bytes);
  Revocations out;
  out.issued_s = r.get<std::int64_t>();
  const auto count = r.get<std::uint32_t>();
  const ByteView keys = r.rest();
  if (!r.ok() || out.issued_s <= 0 || keys.size() != kSignatureBytes + count * kKeyBytes) {
    return std::nullopt;
  }
  out.keys.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::ranges::copy(keys.subspan(i * kKeyBytes, kKeyBytes), out.keys[i].begin());
  }
  return out;
}

bool is_revoked(const Revocations& list, const PublicKey& key) {
  return std::ranges::find(list.keys, key) != list.keys.end();
}

std::string to_text(ByteView bytes) {
  std::string out(sodium_base64_encoded_len(bytes.size(), sodium_base64_VARIANT_ORIGINAL), '\0');
  sodium_bin2base64(out.data(), out.size(), raw(bytes), bytes.size(),
                    sodium_base64_VARIANT_ORIGINAL);
  // The terminating zero.
  out.pop_back();
  return out;
}

std::optional<Bytes> parse_text(std::string_view text) {
  Bytes out(text.size() / 4 * 3);
  if (out.empty()) return text.empty() ? std::optional(out) : std::nullopt;
  std::size_t size = 0;
  if (sodium_base642bin(target(out), out.size(), text.data(), text.size(), nullptr, &size, nullptr,
                        sodium_base64_VARIANT_ORIGINAL) != 0) {
    return std::nullopt;
  }
  out.resize(size);
  return out;
}

}  // namespace crypto
}  // namespace interneuron
