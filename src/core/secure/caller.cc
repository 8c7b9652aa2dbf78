#include "core/secure/caller.h"

#include <algorithm>
#include <stdexcept>

namespace interneuron::crypto {

Caller::Caller(TimePoint now, const Security& security, SessionId life)
    : sessions_(security, life, false, now), life_(life) {
  const auto who = sessions_.trust().only_peer();
  if (!who) throw std::invalid_argument("security: name the one host that is to be measured");
  sessions_.connect(now, kOwner, *who);
}

bool Caller::is_due(TimePoint now) {
  sessions_.handle_timeout(now, kOwner);
  return sessions_.initiation_due(now, kOwner);
}

std::optional<ByteView> Caller::handle(TimePoint now, ByteView datagram) {
  const auto header = wire::peek(datagram);
  if (!header) return std::nullopt;
  if (header->epoch == wire::kClearEpoch) {
    if (wire::is_handshake(header->type))
      sessions_.take_handshake(now, *header, {{}, {}, datagram});
    return std::nullopt;
  }
  const auto by = sessions_.open(now, *header, datagram, opened_);
  if (by.result != Session::Opened::kOk) return std::nullopt;
  const std::span<std::byte> clear = std::span(opened_).first(datagram.size());
  wire::mark_clear(clear, life_);
  std::ranges::fill(clear.last(wire::kTagBytes), std::byte{0});
  return clear;
}

}  // namespace interneuron::crypto
