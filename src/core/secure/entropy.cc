#include "core/secure/entropy.h"

#include <sodium.h>

#include <array>
#include <cstring>

#include "core/secure/bytes.h"

namespace interneuron::crypto {

static_assert(randombytes_SEEDBYTES == kKeyBytes);

SecretKey Entropy::draw_key() {
  std::array<std::byte, 2 * kKeyBytes> stream{};
  randombytes_buf_deterministic(stream.data(), stream.size(), raw(state_.bytes()));
  const std::span<const std::byte> all(stream);
  state_ = SecretKey(all.first<kKeyBytes>());
  const SecretKey out(all.last<kKeyBytes>());
  sodium_memzero(stream.data(), stream.size());
  return out;
}

std::uint64_t Entropy::draw_below(std::uint64_t below) {
  const SecretKey key = draw_key();
  std::uint64_t value = 0;
  std::memcpy(&value, key.bytes().data(), sizeof(value));
  return value % below;
}

std::uint32_t Entropy::draw_index(const Shard& shard) {
  constexpr std::uint32_t kLast = 0xff;
  for (;;) {
    const std::uint32_t drawn = 1 + static_cast<std::uint32_t>(draw_below(UINT32_MAX));
    if (shard.count == 0 || shard.is_door()) return drawn;
    // The nearest below it that tells this shard, which the last few bytes have none of.
    const std::uint32_t last = drawn & kLast;
    const std::uint32_t wanted = last - last % shard.count + shard.index - 1;
    const std::uint32_t index = (drawn & ~kLast) | wanted;
    if (wanted <= kLast && index != 0) return index;
  }
}

}  // namespace interneuron::crypto
