#include "core/secure/session.h"

#include <algorithm>
#include <cassert>

#include "core/secure/aead.h"
#include "core/secure/bytes.h"
#include "core/secure/kdf.h"
#include "core/wire/message_bytes.h"

namespace interneuron::crypto {
namespace {

// What stands before the payload of a message in a packet's body.
static_assert(wire::kHeaderBytes - wire::kAssociatedBytes + wire::kFragmentHeaderBytes +
                  wire::MessageBytes::kMostHeaderBytes <=
              kMostHeadBytes);

}  // namespace

Session::Session(TimePoint born, Role role, std::uint32_t theirs, const Split& keys,
                 std::uint64_t most_packets)
    : born_(born),
      theirs_(theirs),
      cipher_(keys.cipher),
      most_packets_(cipher_ == Cipher::kAesGcm ? most_packets : UINT64_MAX),
      send_(role == Role::kInitiator ? keys.from_initiator : keys.from_responder),
      receive_(role == Role::kInitiator ? keys.from_responder : keys.from_initiator) {}

Session::Lane Session::lane_of(wire::PacketType type, LinkId path) {
  return wire::is_numbered(type) ? path.value : kControl;
}

// The two ciphers never have the same key.
PacketKey Session::lane_key(const SecretKey& direction, Lane lane) const {
  const std::array<std::byte, 3> name{static_cast<std::byte>(lane >> 16U),
                                      static_cast<std::byte>(lane >> 8U),
                                      static_cast<std::byte>(lane)};
  const ByteView label =
      bytes_of(cipher_ == Cipher::kAesGcm ? "interneuron path aes256gcm" : "interneuron path");
  return {cipher_, hmac(direction, label, name)};
}

// A key has sealed one more.
void Session::count(std::uint64_t& packets) {
  if (++packets >= most_packets_ / 2) is_worn_ = true;
}

Session::Sending* Session::sending(Lane lane) {
  const auto it = std::ranges::find(sending_, lane, &Sending::lane);
  if (it != sending_.end()) return &*it;
  // One place is kept for what belongs to no path.
  const std::size_t room = kMaxPaths + (lane == kControl ? 1 : 0);
  if (sending_.size() >= room) return nullptr;
  sending_.push_back({lane, lane_key(send_, lane)});
  return &sending_.back();
}

bool Session::seal(std::span<std::byte> packet, ByteView payload) {
  assert(packet.size() >= wire::kPacketOverhead + payload.size());
  auto header = wire::peek(packet);
  assert(header);
  if (!wire::is_numbered(header->type)) {
    header->number = next_control_++;
    wire::set_number(packet, header->number);
  }
  Sending* const lane = sending(lane_of(header->type, header->link));
  if (lane == nullptr || header->number <= lane->number) return false;
  if (lane->packets >= most_packets_) return false;
  lane->number = header->number;
  count(lane->packets);
  wire::mark_sealed(packet, SessionId{theirs_});
  const auto body = packet.subspan(wire::kAssociatedBytes,
                                   packet.size() - wire::kAssociatedBytes - wire::kTagBytes);
  const ByteView associated = packet.first(wire::kAssociatedBytes);
  lane->key.seal(header->number, associated, body, payload, packet.last(wire::kTagBytes));
  return true;
}

Session::Opened Session::open(const wire::PacketHeader& header, ByteView packet,
                              std::span<std::byte> out) {
  assert(out.size() >= packet.size());
  if (header.epoch != wire::kSealedEpoch || packet.size() < wire::kPacketOverhead)
    return Opened::kForged;
  const Lane lane = lane_of(header.type, header.link);
  const auto known =
      std::ranges::find_if(receiving_, [&](const auto& r) { return r->lane == lane; });
  Receiving* at = known == receiving_.end() ? nullptr : known->get();
  if (at != nullptr && !at->window.is_new(header.number)) return Opened::kReplayed;
  const bool has_room = receiving_.size() < kMaxPaths + (lane == kControl ? 1 : 0);
  if (at == nullptr && !has_room) return Opened::kForged;
  std::optional<PacketKey> fresh;
  if (at == nullptr) fresh = lane_key(receive_, lane);
  const PacketKey& key = at == nullptr ? *fresh : at->key;
  const ByteView associated = packet.first(wire::kAssociatedBytes);
  const ByteView sealed = packet.subspan(wire::kAssociatedBytes,
                                         packet.size() - wire::kAssociatedBytes - wire::kTagBytes);
  if (!key.open(header.number, associated, sealed, packet.last(wire::kTagBytes),
                out.subspan(wire::kAssociatedBytes))) {
    return Opened::kForged;
  }
  std::ranges::copy(associated, out.begin());
  if (at == nullptr) {
    receiving_.push_back(std::make_unique<Receiving>(lane, std::move(*fresh)));
    at = receiving_.back().get();
  }
  at->window.take(header.number);
  count(at->packets);
  return Opened::kOk;
}

}  // namespace interneuron::crypto
