#include "core/secure/aead.h"

#include <sodium.h>

#include <array>
#include <cassert>

#include "core/secure/bytes.h"
#include "core/secure/noise.h"

namespace interneuron::crypto {
namespace {

static_assert(kAeadTagBytes == crypto_aead_chacha20poly1305_ietf_ABYTES);
using Nonce = std::array<unsigned char, crypto_aead_chacha20poly1305_ietf_NPUBBYTES>;

Nonce nonce_of(std::uint64_t counter) {
  Nonce nonce{};
  for (std::size_t i = 0; i < sizeof(counter); ++i) {
    nonce[4 + i] = static_cast<unsigned char>(counter >> (8 * i));
  }
  return nonce;
}

}  // namespace

void aead_seal(const SecretKey& key, std::uint64_t counter, ByteView associated, ByteView plain,
               std::span<std::byte> out, std::span<std::byte> tag) {
  assert(out.size() >= plain.size() && tag.size() == kAeadTagBytes);
  crypto_aead_chacha20poly1305_ietf_encrypt_detached(
      target(out), target(tag), nullptr, raw(plain), plain.size(), raw(associated),
      associated.size(), nullptr, nonce_of(counter).data(), raw(key.bytes()));
}

bool aead_open(const SecretKey& key, std::uint64_t counter, ByteView associated, ByteView sealed,
               ByteView tag, std::span<std::byte> out) {
  assert(out.size() >= sealed.size() && tag.size() == kAeadTagBytes);
  return crypto_aead_chacha20poly1305_ietf_decrypt_detached(
             target(out), nullptr, raw(sealed), sealed.size(), raw(tag), raw(associated),
             associated.size(), nonce_of(counter).data(), raw(key.bytes())) == 0;
}

}  // namespace interneuron::crypto
