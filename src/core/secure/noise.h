// The handshake Noise_IKpsk2_25519_ChaChaPoly_SHA256, and Noise_IK without the shared key, of "The
// Noise Protocol Framework" (revision 34): two messages, after which both sides have the same two
// keys, know that the other one has the private half of its static key, and have revealed the
// initiator's static key to nobody else.
//
//   initiator                                      responder
//     e, es, s, ss, payload  ───────────────────▶  read_first(): who asks
//     read_second()          ◀───────────────────  e, ee, se, psk, payload
//
// What the first message proves: only the initiator or the responder can have made it. Whoever has
// recorded it can send it again, so the payload has to say when it was made. Its payload is not
// forward secret: the responder's static key opens it for ever.
//
// Every message is any bytes: reading gives false where they are not what the other side made, or
// where a public key is a point of low order, whose shared secret everybody knows. After a false
// the object is of no use any more. Secrets are erased with it. Constant memory. Pure;
// thread-compatible.
#pragma once

#include <cstdint>
#include <span>

#include "core/secure/aead.h"
#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

inline constexpr std::size_t kAeadTagBytes = 16;
// What the two messages take beside their payloads: the ephemeral key, in the first one the
// encrypted static key, and the tag of the payload.
inline constexpr std::size_t kFirstMessageBytes =
    kKeyBytes + (kKeyBytes + kAeadTagBytes) + kAeadTagBytes;
inline constexpr std::size_t kSecondMessageBytes = kKeyBytes + kAeadTagBytes;

struct KeyPair {
  SecretKey secret;
  PublicKey open{};
};
KeyPair key_pair_of(const SecretKey& secret);

// The keys of the two directions, and what seals packets with them: the two hosts say that in their
// payloads.
struct Split {
  SecretKey from_initiator;
  SecretKey from_responder;
  Cipher cipher = Cipher::kChaChaPoly;
};

class Noise {
 public:
  enum class Pattern : std::uint8_t { kIk, kIkPsk2 };

  // `prologue`: what both sides must agree on beside their keys. `ephemeral`: drawn at random for
  // this handshake alone; the responder computes its public half only for who is answered.
  static Noise initiator(Pattern pattern, ByteView prologue, const KeyPair& own,
                         const KeyPair& ephemeral, const PublicKey& remote);
  static Noise responder(Pattern pattern, ByteView prologue, const KeyPair& own,
                         const SecretKey& ephemeral);

  // `out`: of kFirstMessageBytes and the payload's size. False: the remote key is of low order.
  bool write_first(std::span<std::byte> out, ByteView payload);
  // `payload`: of the message's size less kFirstMessageBytes.
  bool read_first(ByteView message, std::span<std::byte> payload);
  // The key that the two sides share beside those of the handshake; before the second message.
  void set_shared(const SecretKey& key) { shared_ = key; }
  bool write_second(std::span<std::byte> out, ByteView payload);
  bool read_second(ByteView message, std::span<std::byte> payload);

  // Who the other side is; of the responder after read_first().
  const PublicKey& remote() const { return remote_; }
  // A key that only the two sides can compute since the first message, for one use: `label`.
  SecretKey early_key(std::string_view label) const;
  // After the second message.
  Split split(Cipher cipher = Cipher::kChaChaPoly) const;
  const std::array<std::byte, kKeyBytes>& hash() const { return hash_; }

 private:
  Noise(Pattern pattern, ByteView prologue, const KeyPair& own, const KeyPair& ephemeral,
        const PublicKey& responder);
  void mix_hash(ByteView bytes);
  void mix_key(ByteView secret);
  void mix_key_and_hash(const SecretKey& key);
  bool mix_shared_secret(const SecretKey& secret, const PublicKey& open);
  void mix_ephemeral(const PublicKey& key);
  void seal(std::span<std::byte> out, ByteView plain);
  bool open(ByteView sealed, std::span<std::byte> plain);

  Pattern pattern_;
  KeyPair own_;
  KeyPair ephemeral_;
  PublicKey remote_{};
  PublicKey remote_ephemeral_{};
  SecretKey shared_;
  SecretKey chaining_;
  SecretKey key_;
  std::uint64_t nonce_ = 0;
  std::array<std::byte, kKeyBytes> hash_{};
};

}  // namespace interneuron::crypto
