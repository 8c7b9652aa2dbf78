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
constexpr std::uint8_t kAllFlags = kVariantMask | kNewestOnly | kAwaitsBetter;
static_assert(kMaxVariants == kVariantMask + 1);

}  // namespace

std::optional<PlainHeader> parse_plain_header(ByteView message) {
  if (message.size() < kPlainHeaderBytes) return std::nullopt;
  Reader r(message.first(kPlainHeaderBytes));
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
  if (!r.ok() || h.deadline_us == 0 || (flags & ~kAllFlags) != 0) return std::nullopt;
  // Nothing is better than the best.
  if (h.awaits_better && h.variant == 0) return std::nullopt;
  return h;
}

void write_plain_header(std::span<std::byte, kPlainHeaderBytes> out, const PlainHeader& h) {
  assert(h.deadline_us > 0 && h.variant < kMaxVariants && !(h.awaits_better && h.variant == 0));
  Writer w(out);
  w.put(h.id);
  w.put(h.deadline_us);
  w.put(h.t0.time_since_epoch().count());
  w.put(h.channel);
  w.put(h.importance);
  w.put(static_cast<std::uint8_t>(h.variant | (h.newest_only ? kNewestOnly : 0) |
                                  (h.awaits_better ? kAwaitsBetter : 0)));
  assert(w.ok() && w.size() == kPlainHeaderBytes);
}

}  // namespace interneuron::wire
