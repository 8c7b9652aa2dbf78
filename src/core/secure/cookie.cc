#include "core/secure/cookie.h"

#include <sodium.h>

#include <algorithm>
#include <array>
#include <cassert>

#include "core/secure/bytes.h"
#include "core/secure/handshake.h"
#include "core/wire/bytes.h"

namespace interneuron::crypto {
namespace {

static_assert(kCookieNonceBytes == crypto_aead_xchacha20poly1305_ietf_NPUBBYTES);

// A cookie has as many bytes as a mac; as a key zeros follow.
SecretKey as_key(ByteView cookie) {
  SecretKey key;
  std::ranges::copy(cookie.first(kMacBytes), key.writable().begin());
  return key;
}

}  // namespace

SecretKey Cookies::cookie(const SecretKey& secret, LinkId nic, const Address& from) {
  std::array<std::byte, 64> told{};
  wire::Writer w(told);
  w.put(nic.value);
  w.put(from.size);
  w.put_bytes(from.raw);
  assert(w.ok());
  return as_key(mac_of(secret, std::span(told).first(w.size())));
}

SecretKey Cookies::of(TimePoint now, LinkId nic, const Address& from, Entropy& entropy) {
  if (current_.drawn_at == TimePoint::min() || now - current_.drawn_at >= kSecretLife) {
    former_ = current_;
    current_ = {entropy.draw_key(), now};
  }
  return cookie(current_.key, nic, from);
}

bool Cookies::is_from(TimePoint now, LinkId nic, const Address& from, ByteView mac2,
                      ByteView before_mac2) const {
  const auto fits = [&](const Secret& secret) {
    return secret.drawn_at != TimePoint::min() && now - secret.drawn_at < 2 * kSecretLife &&
           is_mac(mac2, cookie(secret.key, nic, from), before_mac2);
  };
  return fits(current_) || fits(former_);
}

void write_cookie(std::span<std::byte> out, const wire::PacketHeader& answered, ByteView mac1,
                  const SecretKey& key, const SecretKey& cookie, const SecretKey& nonce) {
  assert(out.size() >= kCookieBytes);
  wire::write_header(out, {wire::PacketType::kCookie, answered.link, wire::kClearEpoch,
                           answered.session, answered.number, 0});
  const auto told = out.subspan(wire::kHeaderBytes);
  std::ranges::copy(nonce.bytes().first<kCookieNonceBytes>(), told.begin());
  crypto_aead_xchacha20poly1305_ietf_encrypt(target(told.subspan(kCookieNonceBytes)), nullptr,
                                             raw(cookie.bytes()), kMacBytes, raw(mac1), mac1.size(),
                                             nullptr, raw(nonce.bytes()), raw(key.bytes()));
}

std::optional<SecretKey> open_cookie(const SecretKey& key, ByteView mac1, ByteView packet) {
  if (packet.size() != kCookieBytes) return std::nullopt;
  const ByteView told = packet.subspan(wire::kHeaderBytes);
  const ByteView sealed = told.subspan(kCookieNonceBytes);
  std::array<std::byte, kMacBytes> cookie{};
  if (crypto_aead_xchacha20poly1305_ietf_decrypt(target(cookie), nullptr, nullptr, raw(sealed),
                                                 sealed.size(), raw(mac1), mac1.size(), raw(told),
                                                 raw(key.bytes())) != 0) {
    return std::nullopt;
  }
  return as_key(cookie);
}

}  // namespace interneuron::crypto
