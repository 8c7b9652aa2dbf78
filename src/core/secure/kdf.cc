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

Mac mac_of(const SecretKey& key, ByteView bytes) {
  Mac out{};
  crypto_generichash(target(out), out.size(), raw(bytes), bytes.size(), raw(key.bytes()),
                     kKeyBytes);
  return out;
}

bool is_mac(ByteView mac, const SecretKey& key, ByteView bytes) {
  const Mac expected = mac_of(key, bytes);
  return mac.size() == expected.size() &&
         sodium_memcmp(mac.data(), expected.data(), expected.size()) == 0;
}

}  // namespace interneuron::crypto
