// What include/interneuron/security.h declares.
#include "interneuron/security.h"

#include <sodium.h>

#include "core/secure/bytes.h"

namespace interneuron {

static_assert(kKeyBytes == crypto_scalarmult_curve25519_BYTES);
static_assert(kKeyBytes == crypto_aead_chacha20poly1305_ietf_KEYBYTES);

SecretKey::SecretKey(std::span<const std::byte, kKeyBytes> bytes) {
  std::ranges::copy(bytes, bytes_.begin());
}

SecretKey::~SecretKey() { sodium_memzero(bytes_.data(), bytes_.size()); }

bool operator==(const SecretKey& a, const SecretKey& b) {
  return sodium_memcmp(a.bytes_.data(), b.bytes_.data(), kKeyBytes) == 0;
}

std::string_view to_string(NodeRole role) {
  return role == NodeRole::kVehicle ? "vehicle" : "roadside";
}

PublicKey public_key_of(const SecretKey& secret) {
  PublicKey out{};
  crypto_scalarmult_curve25519_base(crypto::target(out), crypto::raw(secret.bytes()));
  return out;
}

std::string to_base64(std::span<const std::byte, kKeyBytes> key) {
  std::string out(sodium_base64_ENCODED_LEN(kKeyBytes, sodium_base64_VARIANT_ORIGINAL), '\0');
  sodium_bin2base64(out.data(), out.size(), crypto::raw(key), key.size(),
                    sodium_base64_VARIANT_ORIGINAL);
  // The terminating zero.
  out.pop_back();
  return out;
}

std::optional<PublicKey> parse_key(std::string_view text) {
  PublicKey out{};
  std::size_t size = 0;
  const bool is_base64 =
      sodium_base642bin(crypto::target(out), out.size(), text.data(), text.size(), nullptr, &size,
                        nullptr, sodium_base64_VARIANT_ORIGINAL) == 0;
  if (!is_base64 || size != out.size()) return std::nullopt;
  return out;
}

}  // namespace interneuron
