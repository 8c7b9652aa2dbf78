// ChaCha20-Poly1305 (RFC 8439) with the nonce of Noise: four zero bytes, then a counter, little
// endian. Whoever seals twice under one key and counter reveals both texts and lets anybody forge,
// so every caller keeps a counter that only grows.
#pragma once

#include <cstdint>
#include <span>

#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

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

}  // namespace interneuron::crypto
