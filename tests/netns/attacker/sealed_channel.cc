#include "tests/netns/attacker/sealed_channel.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "core/secure/aead.h"
#include "core/secure/bytes.h"
#include "core/secure/kdf.h"
#include "core/secure/session.h"

namespace interneuron::attacker {
namespace {

// The key of a path, or of what belongs to none (docs/wire_format.md, "Sealed packets").
SecretKey lane_key(const SecretKey& direction, wire::PacketType type, LinkId path) {
  const bool has_path = wire::is_numbered(type);
  const std::array<std::byte, 3> name{
      has_path ? std::byte{0} : std::byte{1},
      has_path ? static_cast<std::byte>(path.value >> 8) : std::byte{0},
      has_path ? static_cast<std::byte>(path.value) : std::byte{0}};
  return crypto::hmac(direction, crypto::bytes_of("interneuron path"), name);
}

}  // namespace

PublicKey read_public_key(const std::string& text) {
  const auto key = parse_key(text);
  if (!key) throw std::runtime_error("'" + text + "' is no key of 44 characters");
  return *key;
}

SecretKey read_key(const std::string& file) {
  std::ifstream in(file);
  std::string text;
  if (!std::getline(in, text)) throw std::runtime_error("'" + file + "' cannot be read");
  return SecretKey(read_public_key(text));
}

SecretKey draw_key(std::mt19937_64& random) {
  SecretKey key;
  for (std::size_t i = 0; i < kKeyBytes; i += sizeof(std::uint64_t)) {
    const std::uint64_t drawn = random();
    std::memcpy(key.writable().data() + i, &drawn, sizeof drawn);
  }
  return key;
}

std::int64_t unix_time_ns() {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

SealedChannel::SealedChannel(const Keys& keys, SessionId life, std::mt19937_64& random)
    : random_(random), initiator_(crypto::key_pair_of(keys.own), {keys.road, {}}, life) {}

Bytes SealedChannel::poll(TimePoint now) {
  if (now >= renew_at_) initiator_.begin(now);
  if (!initiator_.is_due(now)) return {};
  if (initiator_.needs_message(now)) {
    const auto index = static_cast<std::uint32_t>(random_()) | 1;
    initiator_.make_message(now, {index, draw_key(random_), unix_time_ns(), 0});
  }
  Bytes out(crypto::kInitiationBytes);
  out.resize(initiator_.write({0}, out));
  initiator_.tried(now);
  return out;
}

SealedChannel::Took SealedChannel::take(TimePoint now, ByteView packet) {
  Took out;
  const auto header = wire::peek(packet);
  if (!header) return out;
  if (header->epoch == wire::kClearEpoch) {
    if (header->type == wire::PacketType::kCookie) initiator_.take_cookie(now, *header, packet);
    if (header->type != wire::PacketType::kResponse) return out;
    const std::uint32_t asked = initiator_.index();
    if (const auto answer = initiator_.take_response(packet)) {
      keys_ = answer->keys;
      index_ = answer->theirs.index;
      life_ = answer->theirs.life.value;
      own_index_ = asked;
      renew_at_ = now + crypto::kRekeyAfter;
      out.token = initiator_.token_of(packet);
    }
    return out;
  }
  if (header->session.value != own_index_ || packet.size() < wire::kPacketOverhead) return out;
  const ByteView associated = packet.first(wire::kAssociatedBytes);
  const ByteView sealed = packet.subspan(wire::kAssociatedBytes,
                                         packet.size() - wire::kAssociatedBytes - wire::kTagBytes);
  Bytes opened(associated.begin(), associated.end());
  opened.resize(packet.size() - wire::kTagBytes);
  const SecretKey key = lane_key(keys_.from_responder, header->type, header->link);
  if (crypto::aead_open(key, header->number, associated, sealed, packet.last(wire::kTagBytes),
                        std::span(opened).subspan(wire::kAssociatedBytes))) {
    out.opened = std::move(opened);
  }
  return out;
}

void SealedChannel::seal(std::span<std::byte> packet) const {
  wire::PacketHeader header;
  // The type may be one that no packet has.
  header.type = static_cast<wire::PacketType>(std::to_integer<std::uint8_t>(packet[0]) & 0x0F);
  header.link = {static_cast<std::uint16_t>(std::to_integer<unsigned>(packet[2]) << 8 |
                                            std::to_integer<unsigned>(packet[3]))};
  for (std::size_t i = 8; i < wire::kAssociatedBytes; ++i) {
    header.number = header.number << 8 | std::to_integer<std::uint64_t>(packet[i]);
  }
  wire::mark_sealed(packet, SessionId{index_});
  const auto body = packet.subspan(wire::kAssociatedBytes,
                                   packet.size() - wire::kAssociatedBytes - wire::kTagBytes);
  crypto::aead_seal(lane_key(keys_.from_initiator, header.type, header.link), header.number,
                    packet.first(wire::kAssociatedBytes), body, body, packet.last(wire::kTagBytes));
}

}  // namespace interneuron::attacker
