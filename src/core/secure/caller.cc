#include "core/secure/caller.h"

#include <algorithm>
#include <stdexcept>

namespace interneuron::crypto {

Caller::Caller(TimePoint now, const Security& security, SessionId life, LinkId path)
    : sessions_(security, life, false, now), life_(life), path_(path) {
  const auto who = sessions_.trust().only_peer();
  if (!who) throw std::invalid_argument("security: name the one host that is to be measured");
  sessions_.connect(now, kOwner, *who);
}

std::size_t Caller::poll(TimePoint now, std::span<std::byte> buffer) {
  sessions_.handle_timeout(now, kOwner);
  if (!sessions_.initiation_due(now, kOwner)) return 0;
  const std::size_t size = sessions_.write_initiation(kOwner, path_, buffer);
  sessions_.initiation_sent(now, kOwner);
  return size;
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

bool Caller::seal(TimePoint now, std::span<std::byte> packet) {
  return sessions_.seal(now, kOwner, packet);
}

}  // namespace interneuron::crypto
