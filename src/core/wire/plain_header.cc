#include "core/wire/plain_header.h"

#include <cassert>

#include "core/wire/bytes.h"
#include "interneuron/message.h"

namespace interneuron::wire {
namespace {

// The last byte: which variant it is, and flags.
constexpr std::uint8_t kVariantMask = 0x07;
constexpr std::uint8_t kNewestOnly = 0x08;
constexpr std::uint8_t kAwaitsBetter = 0x10;
constexpr std::uint8_t kHasNeeds = 0x20;
constexpr std::uint8_t kHasOrder = 0x40;
constexpr std::uint8_t kAllFlags =
    kVariantMask | kNewestOnly | kAwaitsBetter | kHasNeeds | kHasOrder;
static_assert(kMaxVariants == kVariantMask + 1);

}  // namespace

std::size_t plain_header_bytes(std::span<const std::byte, kPlainHeaderBytes> begin) {
  const auto flags = std::to_integer<std::uint8_t>(begin[kPlainHeaderBytes - 1]);
  return kPlainHeaderBytes + ((flags & kHasNeeds) != 0 ? kNeedsBytes : 0) +
         ((flags & kHasOrder) != 0 ? kOrderBytes : 0);
}

std::optional<PlainHeader> parse_plain_header(ByteView message) {
  if (message.size() < kPlainHeaderBytes) return std::nullopt;
  const std::size_t size = plain_header_bytes(message.first<kPlainHeaderBytes>());
  if (message.size() < size) return std::nullopt;
  Reader r(message.first(size));
  PlainHeader h;
  h.id = r.get<std::uint32_t>();
  h.deadline_us = r.get<std::uint32_t>();
  h.t0 = PeerTime{Duration{r.get<std::int64_t>()}};
  h.channel = r.get<std::uint16_t>();
  h.importance = r.get<std::uint8_t>();
  const auto flags = r.get<std::uint8_t>();
  h.variant = flags & kVariantMask;
  h.newest_only = (flags & kNewestOnly) != 0;
  h.awaits_better = (flags & kAwaitsBetter) != 0;
  if ((flags & kHasNeeds) != 0) {
    h.needs = PlainHeader::Needs{};
    for (std::uint8_t& weight : h.needs->weights) weight = r.get<std::uint8_t>();
    h.needs->min_security = r.get<std::uint8_t>();
  }
  if ((flags & kHasOrder) != 0) {
    h.order = PlainHeader::Order{};
    h.order->back = r.get<std::uint16_t>();
    h.order->wait_us = r.get<std::uint32_t>();
  }
  if (!r.ok() || h.deadline_us == 0 || (flags & ~kAllFlags) != 0) return std::nullopt;
  // Nothing is better than the best.
  if (h.awaits_better && h.variant == 0) return std::nullopt;
  return h;
}

void write_plain_header(std::span<std::byte> out, const PlainHeader& h) {
  assert(h.deadline_us > 0 && h.variant < kMaxVariants && !(h.awaits_better && h.variant == 0));
  Writer w(out.first(h.bytes()));
  w.put(h.id);
  w.put(h.deadline_us);
  w.put(h.t0.time_since_epoch().count());
  w.put(h.channel);
  w.put(h.importance);
  w.put(static_cast<std::uint8_t>(h.variant | (h.newest_only ? kNewestOnly : 0) |
                                  (h.awaits_better ? kAwaitsBetter : 0) |
                                  (h.needs ? kHasNeeds : 0) | (h.order ? kHasOrder : 0)));
  if (h.needs) {
    for (const std::uint8_t weight : h.needs->weights) w.put(weight);
    w.put(h.needs->min_security);
  }
  if (h.order) {
    w.put(h.order->back);
    w.put(h.order->wait_us);
  }
  assert(w.ok() && w.size() == h.bytes());
}

}  // namespace interneuron::wire
