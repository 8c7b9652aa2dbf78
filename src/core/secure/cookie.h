// Cookies: how a responder under load finds out whether who asks receives at the address that he
// asks from, without remembering him ("WireGuard: Next Generation Kernel Network Tunnel",
// Donenfeld). A cookie is a code over the address under a secret that is drawn anew every two
// minutes; it is sent encrypted, so that only who knows whom he asks can use it, and bound to mac1
// of what it answers, so that nobody else's answer is taken for it. Pure; thread-compatible.
#pragma once

#include <optional>
#include <span>

#include "core/secure/entropy.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"
#include "interneuron/security.h"
#include "interneuron/time.h"

namespace interneuron::crypto {

class Cookies {
 public:
  static constexpr Duration kSecretLife = std::chrono::seconds(120);

  // The cookie for this address; the secret is renewed first where it is old.
  SecretKey of(TimePoint now, LinkId nic, const Address& from, Entropy& entropy);
  // Whether mac2 was made with a cookie for this address that is at most twice kSecretLife old.
  bool is_from(TimePoint now, LinkId nic, const Address& from, ByteView mac2,
               ByteView before_mac2) const;

 private:
  struct Secret {
    SecretKey key;
    TimePoint drawn_at = TimePoint::min();
  };
  static SecretKey cookie(const SecretKey& secret, LinkId nic, const Address& from);

  Secret current_;
  Secret former_;
};

// Writes the reply that brings the cookie to who sent a packet with this header and mac1. `key`: of
// cookies to this host.
void write_cookie(std::span<std::byte> out, const wire::PacketHeader& answered, ByteView mac1,
                  const SecretKey& key, const SecretKey& cookie, const SecretKey& nonce);
std::optional<SecretKey> open_cookie(const SecretKey& key, ByteView mac1, ByteView packet);

}  // namespace interneuron::crypto
