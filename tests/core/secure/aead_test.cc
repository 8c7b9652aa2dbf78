// A text that is sealed in two parts is the text that libsodium seals in one piece.
#include "core/secure/aead.h"

#include <gtest/gtest.h>

#include "core/secure/noise.h"

namespace interneuron::crypto::aead_test {
namespace {

Bytes pattern(std::size_t size, unsigned seed) {
  Bytes out(size);
  for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<std::byte>(seed + i * i + i / 7);
  return out;
}

TEST(Aead, PartsAreSealedAsTheWholeIs) {
  std::array<std::byte, kKeyBytes> bytes{};
  bytes.fill(std::byte{0x5a});
  const SecretKey key(bytes);
  for (const std::size_t associated : {0U, 1U, 16U, 20U}) {
    const Bytes header = pattern(associated, 3);
    for (std::size_t head = 0; head <= kMostHeadBytes; ++head) {
      for (const std::size_t rest : {0U, 1U, 15U, 16U, 42U, 43U, 44U, 107U, 128U, 1000U, 1363U}) {
        // Packets have a head, and libsodium wants an address even for nothing.
        if (head + rest == 0) continue;
        const Bytes text = pattern(head + rest, static_cast<unsigned>(head));
        Bytes whole(text.size());
        std::array<std::byte, kAeadTagBytes> tag{};
        const std::uint64_t counter = (std::uint64_t{1} << 40U) + head;
        aead_seal(key, counter, header, text, whole, tag);

        Bytes parts(text.size(), std::byte{0xee});
        std::copy_n(text.begin(), head, parts.begin());
        std::array<std::byte, kAeadTagBytes> tag_of_parts{};
        aead_seal_parts(key, counter, header, head, ByteView(text).subspan(head), parts,
                        tag_of_parts);
        ASSERT_EQ(parts, whole) << head << " + " << rest;
        ASSERT_EQ(tag_of_parts, tag) << head << " + " << rest;
      }
    }
  }
}

TEST(PacketKey, SealsWhereItIsWhatLiesInTwoParts) {
  std::array<std::byte, kKeyBytes> bytes{};
  bytes.fill(std::byte{0x5a});
  for (const Cipher cipher : {Cipher::kChaChaPoly, common_cipher(kHasAesGcm, ciphers_here())}) {
    const PacketKey key(cipher, SecretKey(bytes));
    const Bytes header = pattern(16, 3);
    for (const std::size_t rest : {0U, 1U, 16U, 44U, 1000U, 1363U}) {
      const Bytes text = pattern(41 + rest, 7);
      Bytes whole = text;
      std::array<std::byte, kAeadTagBytes> tag{};
      key.seal(rest, header, whole, {}, tag);
      Bytes parts(text.size(), std::byte{0xee});
      std::copy_n(text.begin(), 41, parts.begin());
      std::array<std::byte, kAeadTagBytes> tag_of_parts{};
      key.seal(rest, header, parts, ByteView(text).subspan(41), tag_of_parts);
      ASSERT_EQ(parts, whole) << rest;
      ASSERT_EQ(tag_of_parts, tag) << rest;
      Bytes opened(text.size());
      ASSERT_TRUE(key.open(rest, header, whole, tag, opened));
      EXPECT_EQ(opened, text);
      EXPECT_FALSE(key.open(rest + 1, header, whole, tag, opened));
    }
  }
}

}  // namespace
}  // namespace interneuron::crypto::aead_test
