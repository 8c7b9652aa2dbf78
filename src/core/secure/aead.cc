#include "core/secure/aead.h"

#include <sodium.h>

#include <algorithm>
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

static_assert(kKeyBytes == crypto_aead_aes256gcm_KEYBYTES);
static_assert(kAeadTagBytes == crypto_aead_aes256gcm_ABYTES);
static_assert(sizeof(Nonce) == crypto_aead_aes256gcm_NPUBBYTES);

Nonce big_endian_nonce_of(std::uint64_t counter) {
  Nonce nonce = nonce_of(counter);
  std::reverse(nonce.begin() + 4, nonce.end());
  return nonce;
}

// The key stream comes in blocks (RFC 8439 §2.3).
constexpr std::size_t kBlockBytes = 64;

// What is authenticated is filled up to a multiple of 16 bytes (RFC 8439 §2.8).
void authenticate(crypto_onetimeauth_poly1305_state& state, ByteView bytes) {
  constexpr std::size_t kStep = 16;
  constexpr std::array<unsigned char, kStep> kZeros{};
  crypto_onetimeauth_poly1305_update(&state, raw(bytes), bytes.size());
  crypto_onetimeauth_poly1305_update(&state, kZeros.data(), (kStep - bytes.size() % kStep) % kStep);
}

}  // namespace

Ciphers ciphers_here() {
  const bool is_started = sodium_init() >= 0;
  return is_started && crypto_aead_aes256gcm_is_available() != 0 ? kHasAesGcm : 0;
}

void aead_seal(const SecretKey& key, std::uint64_t counter, ByteView associated, ByteView plain,
               std::span<std::byte> out, std::span<std::byte> tag) {
  assert(out.size() >= plain.size() && tag.size() == kAeadTagBytes);
  crypto_aead_chacha20poly1305_ietf_encrypt_detached(
      target(out), target(tag), nullptr, raw(plain), plain.size(), raw(associated),
      associated.size(), nullptr, nonce_of(counter).data(), raw(key.bytes()));
}

// What libsodium does in one call with a text in one piece (RFC 8439 §2.8), out of the same parts
// of it. Block 0 of the key stream is the key of the code, and the text begins with block 1. The
// blocks that the first part takes, the last of which reaches into the second, are added byte by
// byte; with the block after them libsodium goes on alone.
void aead_seal_parts(const SecretKey& key, std::uint64_t counter, ByteView associated,
                     std::size_t head, ByteView rest, std::span<std::byte> out,
                     std::span<std::byte> tag) {
  const std::size_t size = head + rest.size();
  assert(head <= kMostHeadBytes && out.size() >= size && tag.size() == kAeadTagBytes);
  const Nonce nonce = nonce_of(counter);
  const std::size_t blocks = head / kBlockBytes + 1;
  std::array<std::byte, kBlockBytes*(1 + (kMostHeadBytes + 1) / kBlockBytes)> stream;
  crypto_stream_chacha20_ietf(target(stream), (1 + blocks) * kBlockBytes, nonce.data(),
                              raw(key.bytes()));
  const ByteView mask = ByteView(stream).subspan(kBlockBytes, blocks * kBlockBytes);
  const std::size_t both = std::min(mask.size(), size);
  for (std::size_t i = 0; i < head; ++i) out[i] ^= mask[i];
  for (std::size_t i = head; i < both; ++i) out[i] = rest[i - head] ^ mask[i];
  const ByteView alone = rest.subspan(both - head);
  crypto_stream_chacha20_ietf_xor_ic(target(out.subspan(both)), raw(alone), alone.size(),
                                     nonce.data(), static_cast<std::uint32_t>(1 + blocks),
                                     raw(key.bytes()));
  crypto_onetimeauth_poly1305_state code;
  crypto_onetimeauth_poly1305_init(&code, raw(stream));
  sodium_memzero(stream.data(), stream.size());
  authenticate(code, associated);
  authenticate(code, out.first(size));
  std::array<std::byte, 2 * sizeof(std::uint64_t)> sizes{};
  for (std::size_t i = 0; i < sizeof(std::uint64_t); ++i) {
    sizes[i] = static_cast<std::byte>(std::uint64_t{associated.size()} >> (8 * i));
    sizes[sizeof(std::uint64_t) + i] = static_cast<std::byte>(std::uint64_t{size} >> (8 * i));
  }
  crypto_onetimeauth_poly1305_update(&code, raw(sizes), sizes.size());
  crypto_onetimeauth_poly1305_final(&code, target(tag));
  sodium_memzero(&code, sizeof(code));
}

bool aead_open(const SecretKey& key, std::uint64_t counter, ByteView associated, ByteView sealed,
               ByteView tag, std::span<std::byte> out) {
  assert(out.size() >= sealed.size() && tag.size() == kAeadTagBytes);
  return crypto_aead_chacha20poly1305_ietf_decrypt_detached(
             target(out), nullptr, raw(sealed), sealed.size(), raw(tag), raw(associated),
             associated.size(), nonce_of(counter).data(), raw(key.bytes())) == 0;
}

struct PacketKey::Schedule {
  crypto_aead_aes256gcm_state state;
};

void PacketKey::Erase::operator()(Schedule* schedule) const {
  sodium_memzero(&schedule->state, sizeof(schedule->state));
  delete schedule;
}

PacketKey::PacketKey(Cipher cipher, const SecretKey& key) {
  if (cipher == Cipher::kChaChaPoly) {
    key_ = key;
    return;
  }
  assert((ciphers_here() & kHasAesGcm) != 0);
  aes_.reset(new Schedule);
  crypto_aead_aes256gcm_beforenm(&aes_->state, raw(key.bytes()));
}

void PacketKey::seal(std::uint64_t counter, ByteView associated, std::span<std::byte> body,
                     ByteView payload, std::span<std::byte> tag) const {
  if (aes_ != nullptr) {
    // A copy costs a fortieth of sealing it.
    std::ranges::copy(payload, body.last(payload.size()).begin());
    crypto_aead_aes256gcm_encrypt_detached_afternm(
        target(body), target(tag), nullptr, raw(body), body.size(), raw(associated),
        associated.size(), nullptr, big_endian_nonce_of(counter).data(), &aes_->state);
  } else if (payload.empty()) {
    aead_seal(key_, counter, associated, body, body, tag);
  } else {
    aead_seal_parts(key_, counter, associated, body.size() - payload.size(), payload, body, tag);
  }
}

bool PacketKey::open(std::uint64_t counter, ByteView associated, ByteView sealed, ByteView tag,
                     std::span<std::byte> out) const {
  if (aes_ == nullptr) return aead_open(key_, counter, associated, sealed, tag, out);
  assert(out.size() >= sealed.size() && tag.size() == kAeadTagBytes);
  return crypto_aead_aes256gcm_decrypt_detached_afternm(
             target(out), nullptr, raw(sealed), sealed.size(), raw(tag), raw(associated),
             associated.size(), big_endian_nonce_of(counter).data(), &aes_->state) == 0;
}

}  // namespace interneuron::crypto
