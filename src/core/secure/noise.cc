#include "core/secure/noise.h"

#include <sodium.h>

#include <algorithm>
#include <cassert>

#include "core/secure/aead.h"
#include "core/secure/bytes.h"
#include "core/secure/kdf.h"

namespace interneuron::crypto {
namespace {

std::string_view name_of(Noise::Pattern pattern) {
  return pattern == Noise::Pattern::kIk ? "Noise_IK_25519_ChaChaPoly_SHA256"
                                        : "Noise_IKpsk2_25519_ChaChaPoly_SHA256";
}

}  // namespace

KeyPair key_pair_of(const SecretKey& secret) { return {secret, public_key_of(secret)}; }

Noise::Noise(Pattern pattern, ByteView prologue, const KeyPair& own, const KeyPair& ephemeral,
             const PublicKey& responder)
    : pattern_(pattern), own_(own), ephemeral_(ephemeral) {
  const ByteView name = bytes_of(name_of(pattern));
  if (name.size() <= hash_.size()) {
    std::ranges::copy(name, hash_.begin());
  } else {
    crypto_hash_sha256(target(hash_), raw(name), name.size());
  }
  chaining_ = SecretKey(hash_);
  mix_hash(prologue);
  mix_hash(responder);
}

Noise Noise::initiator(Pattern pattern, ByteView prologue, const KeyPair& own,
                       const KeyPair& ephemeral, const PublicKey& remote) {
  Noise noise(pattern, prologue, own, ephemeral, remote);
  noise.remote_ = remote;
  return noise;
}

Noise Noise::responder(Pattern pattern, ByteView prologue, const KeyPair& own,
                       const SecretKey& ephemeral) {
  return Noise(pattern, prologue, own, {ephemeral, {}}, own.open);
}

void Noise::mix_hash(ByteView bytes) {
  crypto_hash_sha256_state state;
  crypto_hash_sha256_init(&state);
  crypto_hash_sha256_update(&state, raw(hash_), hash_.size());
  crypto_hash_sha256_update(&state, raw(bytes), bytes.size());
  crypto_hash_sha256_final(&state, target(hash_));
}

void Noise::mix_key(ByteView secret) {
  const auto keys = derive(chaining_, secret);
  chaining_ = keys[0];
  key_ = keys[1];
  nonce_ = 0;
}

void Noise::mix_key_and_hash(const SecretKey& key) {
  const auto keys = derive(chaining_, key.bytes());
  chaining_ = keys[0];
  mix_hash(keys[1].bytes());
  key_ = keys[2];
  nonce_ = 0;
}

bool Noise::mix_shared_secret(const SecretKey& secret, const PublicKey& open) {
  SecretKey shared;
  if (crypto_scalarmult_curve25519(target(shared.writable()), raw(secret.bytes()),
                                   raw(ByteView(open))) != 0) {
    return false;
  }
  mix_key(shared.bytes());
  return true;
}

// In a handshake with a shared key an ephemeral key counts as a secret too, so that two handshakes
// with the same keys differ.
void Noise::mix_ephemeral(const PublicKey& key) {
  mix_hash(key);
  if (pattern_ == Pattern::kIkPsk2) mix_key(key);
}

void Noise::seal(std::span<std::byte> out, ByteView plain) {
  aead_seal(key_, nonce_++, hash_, plain, out.first(plain.size()), out.subspan(plain.size()));
  mix_hash(out);
}

bool Noise::open(ByteView sealed, std::span<std::byte> plain) {
  if (!aead_open(key_, nonce_++, hash_, sealed.first(sealed.size() - kAeadTagBytes),
                 sealed.last(kAeadTagBytes), plain)) {
    return false;
  }
  mix_hash(sealed);
  return true;
}

bool Noise::write_first(std::span<std::byte> out, ByteView payload) {
  assert(out.size() == kFirstMessageBytes + payload.size());
  std::ranges::copy(ephemeral_.open, out.begin());
  mix_ephemeral(ephemeral_.open);
  if (!mix_shared_secret(ephemeral_.secret, remote_)) return false;
  seal(out.subspan(kKeyBytes, kKeyBytes + kAeadTagBytes), own_.open);
  if (!mix_shared_secret(own_.secret, remote_)) return false;
  seal(out.subspan(2 * kKeyBytes + kAeadTagBytes), payload);
  return true;
}

bool Noise::read_first(ByteView message, std::span<std::byte> payload) {
  if (message.size() != kFirstMessageBytes + payload.size()) return false;
  std::ranges::copy(message.first(kKeyBytes), remote_ephemeral_.begin());
  mix_ephemeral(remote_ephemeral_);
  return mix_shared_secret(own_.secret, remote_ephemeral_) &&
         open(message.subspan(kKeyBytes, kKeyBytes + kAeadTagBytes), remote_) &&
         mix_shared_secret(own_.secret, remote_) &&
         open(message.subspan(2 * kKeyBytes + kAeadTagBytes), payload);
}

bool Noise::write_second(std::span<std::byte> out, ByteView payload) {
  assert(out.size() == kSecondMessageBytes + payload.size());
  ephemeral_.open = public_key_of(ephemeral_.secret);
  std::ranges::copy(ephemeral_.open, out.begin());
  mix_ephemeral(ephemeral_.open);
  if (!mix_shared_secret(ephemeral_.secret, remote_ephemeral_) ||
      !mix_shared_secret(ephemeral_.secret, remote_)) {
    return false;
  }
  if (pattern_ == Pattern::kIkPsk2) mix_key_and_hash(shared_);
  seal(out.subspan(kKeyBytes), payload);
  return true;
}

bool Noise::read_second(ByteView message, std::span<std::byte> payload) {
  if (message.size() != kSecondMessageBytes + payload.size()) return false;
  std::ranges::copy(message.first(kKeyBytes), remote_ephemeral_.begin());
  mix_ephemeral(remote_ephemeral_);
  if (!mix_shared_secret(ephemeral_.secret, remote_ephemeral_) ||
      !mix_shared_secret(own_.secret, remote_ephemeral_)) {
    return false;
  }
  if (pattern_ == Pattern::kIkPsk2) mix_key_and_hash(shared_);
  return open(message.subspan(kKeyBytes), payload);
}

SecretKey Noise::early_key(std::string_view label) const {
  return hmac(chaining_, bytes_of(label));
}

Split Noise::split(Cipher cipher) const {
  auto keys = derive(chaining_, {});
  return {keys[0], keys[1], cipher};
}

}  // namespace interneuron::crypto
