// What packets and the pieces of messages begin with, as values: types, numbers, sizes. packet.h
// reads and writes them; docs/wire_format.md is the authority. Pure.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/sizes.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::wire {

// The version of this format, in the upper half of a packet's first byte. Version 1 had the type
// alone there.
inline constexpr std::uint8_t kVersion = 3;

// Types 11 … 15 are not used.
enum class PacketType : std::uint8_t {
  kData = 1,
  kFeedback = 2,
  kProbe = 3,
  kEcho = 4,
  // The three of the agreement on keys (src/core/secure/handshake.h).
  kInitiation = 5,
  kWindow = 6,
  kChallenge = 7,
  kToken = 8,
  kResponse = 9,
  kCookie = 10,
};
constexpr bool is_handshake(PacketType type) {
  return type == PacketType::kInitiation || type == PacketType::kResponse ||
         type == PacketType::kCookie;
}
// Whether packets of this type mean something between peers.
constexpr bool is_used(PacketType type) {
  return type >= PacketType::kData && type <= PacketType::kToken && !is_handshake(type);
}
// Whether packets of this type have numbers of their path; the others belong to none.
constexpr bool is_numbered(PacketType type) {
  return type != PacketType::kEcho && type != PacketType::kChallenge && !is_handshake(type);
}

inline constexpr std::size_t kHeaderBytes = 20;
// How many bytes of the header are authenticated and not encrypted. The stamp behind it is
// encrypted.
inline constexpr std::size_t kAssociatedBytes = 16;
inline constexpr std::size_t kTagBytes = 16;
inline constexpr std::size_t kFragmentHeaderBytes = 17;
inline constexpr std::size_t kPacketOverhead = kHeaderBytes + kTagBytes;
static_assert(kPieceOverheadBytes == kPacketOverhead + kFragmentHeaderBytes);
inline constexpr std::uint8_t kClearEpoch = 0;
inline constexpr std::uint8_t kSealedEpoch = 1;

// What every packet begins with.
struct PacketHeader {
  PacketType type{};
  LinkId link{};
  std::uint8_t epoch = kClearEpoch;
  // In the clear the sender's session, sealed the number that the receiver has given to the keys;
  // not 0.
  SessionId session{};
  // The packet number: grows by one per packet of a sender on a path; starts anywhere above 0.
  std::uint64_t number = 0;
  // When the packet was made; send_stamp() of the time of the sender's session.
  std::uint32_t stamp_us = 0;
  friend bool operator==(const PacketHeader&, const PacketHeader&) = default;
};

// An instant as packets carry it: microseconds modulo 2^32, which is 71.6 minutes.
constexpr std::uint32_t send_stamp(TimePoint t) {
  return static_cast<std::uint32_t>(
      std::chrono::floor<std::chrono::microseconds>(t.time_since_epoch()).count());
}

enum class MessageKind : std::uint8_t {
  // The message begins with a round header (round_header.h).
  kRound = 0,
  // The message begins with a plain header (plain_header.h).
  kPlain = 1,
  // The message is a list of revocations that an authority has signed (src/core/secure/).
  kRevocations = 2,
};
inline constexpr MessageKind kLastKind = MessageKind::kRevocations;

// A deadline, a period or a lifetime as headers tell it, in microseconds. It is rounded up, so that
// what is in time by the sender's word is in time by its header; only no time at all is told as 0.
// From 71 minutes on all times are told as the largest one.
constexpr std::uint32_t to_us(Duration d) {
  const auto us = std::chrono::ceil<std::chrono::microseconds>(d).count();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(us, 0, UINT32_MAX));
}

// A share in [0, 1] as headers tell it.
inline std::uint8_t share_of_255(double share) {
  return share > 0 ? static_cast<std::uint8_t>(std::min(share, 1.0) * 255.0 + 0.5) : 0;
}

// One fragment of a message of `size` bytes, which is cut into count() pieces: piece `index` starts
// at byte index * chunk of the message; all but the last have `chunk` bytes. An index from count()
// on is that of a repair symbol: `chunk` bytes that were computed from the pieces of a block, both
// of which follow from the index (code::Blocks).
struct FragmentHeader {
  MessageId message{};
  std::uint16_t index = 0;
  std::uint16_t chunk = 1;
  std::uint32_t size = 1;
  // How long the receiver may wait for the other fragments, in microseconds: the end-to-end
  // deadline of the round.
  std::uint32_t lifetime_us = 0;
  MessageKind kind = MessageKind::kRound;

  // How many pieces there are: 1 … 65,535 where parse() gave the fragment.
  constexpr std::uint16_t count() const {
    return static_cast<std::uint16_t>((size + chunk - std::uint64_t{1}) / chunk);
  }
  constexpr bool is_repair() const { return index >= count(); }
  // How many bytes follow the header.
  constexpr std::size_t bytes() const {
    const std::uint64_t begin = std::uint64_t{index} * chunk;
    return is_repair() ? chunk : std::min<std::uint64_t>(chunk, size - begin);
  }
  friend bool operator==(const FragmentHeader&, const FragmentHeader&) = default;
};

// What the header says of any packet of this version, sealed or not, but for the stamp; nothing
// where it cannot be one.
std::optional<PacketHeader> peek(ByteView datagram);
// Makes the epoch that of sealed packets and changes the session, in the header of a packet that
// was written.
void mark_sealed(std::span<std::byte> packet, SessionId session);
// The other way round.
void mark_clear(std::span<std::byte> packet, SessionId session);
// Changes the number in the header of a packet that was written.
void set_number(std::span<std::byte> packet, std::uint64_t number);
// A header alone.
void write_header(std::span<std::byte> out, const PacketHeader& header);

}  // namespace interneuron::wire
