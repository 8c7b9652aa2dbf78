#include "core/secure/kdf.h"

#include <sodium.h>

#include "core/secure/bytes.h"

namespace interneuron::crypto {

static_assert(crypto_auth_hmacsha256_BYTES == kKeyBytes);

SecretKey hmac(const SecretKey& key, ByteView first, ByteView second) {
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, raw(key.bytes()), kKeyBytes);
  crypto_auth_hmacsha256_update(&state, raw(first), first.size());
  crypto_auth_hmacsha256_update(&state, raw(second), second.size());
  SecretKey out;
  crypto_auth_hmacsha256_final(&state, target(out.writable()));
  sodium_memzero(&state, sizeof(state));
  return out;
}

std::array<SecretKey, 3> derive(const SecretKey& chaining, ByteView input) {
  constexpr std::array<std::byte, 3> kCounter{std::byte{1}, std::byte{2}, std::byte{3}};
  const std::span counter(kCounter);
  const SecretKey extracted = hmac(chaining, input);
  std::array<SecretKey, 3> out;
  out[0] = hmac(extracted, counter.subspan(0, 1));
  out[1] = hmac(extracted, out[0].bytes(), counter.subspan(1, 1));
  out[2] = hmac(extracted, out[1].bytes(), counter.subspan(2, 1));
  return out;
}

}  // namespace interneuron::crypto
