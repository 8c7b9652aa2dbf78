#include "tests/netns/attacker/initiations.h"

#include <algorithm>

#include "core/secure/cookie.h"
#include "core/wire/bytes.h"
#include "tests/netns/attacker/sealed_channel.h"

namespace interneuron::attacker {
namespace {

// A host that has refused a key does not remember it, so that few do for any number.
constexpr std::size_t kWhole = 256;

}  // namespace

// The place of each of whole() in the list is in its session.
Initiations::Initiations(const PublicKey& road, std::mt19937_64& random)
    : random_(random),
      mac1_key_(crypto::mac1_key(road)),
      cookie_key_(crypto::cookie_key(road)),
      buffer_(crypto::kInitiationBytes) {
  const TimePoint any{};
  for (std::size_t i = 0; i < kWhole; ++i) {
    crypto::Initiator initiator(crypto::key_pair_of(draw_key(random)), {road, {}},
                                SessionId{static_cast<std::uint32_t>(random()) | 1});
    initiator.begin(any);
    initiator.make_message(
        any, {static_cast<std::uint32_t>(i + 1), draw_key(random), unix_time_ns(), 0});
    initiator.write({0}, buffer_);
    whole_.push_back(buffer_);
  }
}

void Initiations::put_code(const SecretKey& key, ByteView before, ByteView at) {
  std::ranges::copy(crypto::mac_of(key, before), buffer_.begin() + (at.data() - buffer_.data()));
}

ByteView Initiations::random() {
  wire::Writer w(buffer_);
  while (w.size() + sizeof(std::uint64_t) <= buffer_.size()) w.put(random_());
  wire::write_header(buffer_, {.type = wire::PacketType::kInitiation,
                               .link = {static_cast<std::uint16_t>(random_() & 3)},
                               .session = {static_cast<std::uint32_t>(random_()) | 1},
                               .number = 1 + (random_() & 3)});
  const auto parts = crypto::parts_of_initiation(buffer_);
  put_code(mac1_key_, parts.before_mac1, parts.mac1);
  return buffer_;
}

ByteView Initiations::whole() { return whole_[random_() % whole_.size()]; }

ByteView Initiations::with_cookie(ByteView cookie) {
  const auto header = wire::peek(cookie);
  if (!header || header->type != wire::PacketType::kCookie) return {};
  if (header->session.value == 0 || header->session.value > whole_.size()) return {};
  buffer_ = whole_[header->session.value - 1];
  const auto parts = crypto::parts_of_initiation(buffer_);
  const auto key = crypto::open_cookie(cookie_key_, parts.mac1, cookie);
  if (!key) return {};
  put_code(*key, parts.before_mac2, parts.mac2);
  return buffer_;
}

}  // namespace interneuron::attacker
