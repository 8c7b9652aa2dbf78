// ChaCha20-Poly1305 (RFC 8439) with the nonce of Noise: four zero bytes, then a counter, little
// endian. Whoever seals twice under one key and counter reveals both texts and lets anybody forge,
// so every caller keeps a counter that only grows.
//
// Packets are sealed by it or by AES-256-GCM (RFC 5116), which is cheaper where the processor has
// instructions for it; their nonces are Noise's, too, which for this one has the counter big
// endian. Which of the two it is follows from what both hosts say in their handshake.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

enum class Cipher : std::uint8_t { kChaChaPoly, kAesGcm };
// What a host says that it can beside ChaCha20-Poly1305, in bits.
using Ciphers = std::uint8_t;
inline constexpr Ciphers kHasAesGcm = 0x01;
// What this host can. The first call lets libsodium find out what the processor can do, without
// which it takes two and a half times as long for all that it does. Thread-safe.
Ciphers ciphers_here();
// What two hosts seal with that have said this. Bits that nobody knows are of no account.
constexpr Cipher common_cipher(Ciphers one, Ciphers other) {
  return (one & other & kHasAesGcm) != 0 ? Cipher::kAesGcm : Cipher::kChaChaPoly;
}

// `plain` may be where `out` is; the tag is written to `tag`, of kAeadTagBytes.
void aead_seal(const SecretKey& key, std::uint64_t counter, ByteView associated, ByteView plain,
               std::span<std::byte> out, std::span<std::byte> tag);
// Seals a text that lies in two parts, with the same result as aead_seal() of both in one piece.
// The first `head` bytes of `out`, at most kMostHeadBytes, hold the first part and are encrypted
// where they are; `rest` is the second, which is read where it lies and written behind the first,
// encrypted, so that nobody has to join them.
inline constexpr std::size_t kMostHeadBytes = 127;
void aead_seal_parts(const SecretKey& key, std::uint64_t counter, ByteView associated,
                     std::size_t head, ByteView rest, std::span<std::byte> out,
                     std::span<std::byte> tag);
// False: the bytes are not what was sealed, and nothing that is of use was written to `out`.
bool aead_open(const SecretKey& key, std::uint64_t counter, ByteView associated, ByteView sealed,
               ByteView tag, std::span<std::byte> out);

// A key of either cipher. What AES computes of a key is computed once and takes 512 bytes; they are
// erased with it. Thread-compatible.
class PacketKey {
 public:
  // AES-256-GCM only where ciphers_here() has it.
  PacketKey(Cipher cipher, const SecretKey& key);

  // Seals `body` where it is. `payload`: its last bytes where these lie elsewhere; then it has at
  // most kMostHeadBytes before them.
  void seal(std::uint64_t counter, ByteView associated, std::span<std::byte> body, ByteView payload,
            std::span<std::byte> tag) const;
  // As aead_open().
  bool open(std::uint64_t counter, ByteView associated, ByteView sealed, ByteView tag,
            std::span<std::byte> out) const;

 private:
  struct Schedule;
  struct Erase {
    void operator()(Schedule* schedule) const;
  };
  // Of ChaCha20-Poly1305; zero of AES-256-GCM.
  SecretKey key_;
  std::unique_ptr<Schedule, Erase> aes_;
};

}  // namespace interneuron::crypto
