// Packets <-> bytes. docs/wire_format.md is the authority.
//
// A packet is one UDP payload: header (16 bytes), body, tag (16 bytes). Epoch 0 is the clear: its
// tag is all zero and anything else is malformed, so that a later authenticated epoch needs no new
// format. A parsed packet is always valid; parse() returns nothing for any other bytes and never
// throws. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::wire {

enum class PacketType : std::uint8_t { kData = 1, kFeedback = 2, kProbe = 3 };

inline constexpr std::size_t kHeaderBytes = 16;
inline constexpr std::size_t kTagBytes = 16;
inline constexpr std::size_t kFragmentHeaderBytes = 16;
inline constexpr std::size_t kPacketOverhead = kHeaderBytes + kTagBytes;
inline constexpr std::size_t kFragmentOverhead = kPacketOverhead + kFragmentHeaderBytes;
inline constexpr std::uint8_t kClearEpoch = 0;

struct PacketHeader {
  PacketType type{};
  LinkId link{};
  std::uint8_t epoch = kClearEpoch;
  SessionId session{};       // the sender's
  std::uint64_t number = 0;  // grows per sender and path; starts anywhere above 0
  friend bool operator==(const PacketHeader&, const PacketHeader&) = default;
};

// One piece of a message. Piece i starts at i * chunk; all but the last have `chunk` bytes.
struct FragmentHeader {
  MessageId message{};
  std::uint16_t index = 0;
  std::uint16_t count = 1;
  std::uint16_t chunk = 1;
  std::uint32_t lifetime_us = 0;  // D_N: how long the receiver may wait for the rest
  friend bool operator==(const FragmentHeader&, const FragmentHeader&) = default;
};

// Which of the kAckWindow packets before the largest have arrived.
inline constexpr std::size_t kAckWindow = 256;
using AckBitmap = std::array<std::uint64_t, kAckWindow / 64>;

// What the sender of the feedback has seen on one link.
struct LinkReport {
  LinkId link{};
  // Clock exchange (NOTES §4.2): the newest u received on this link, and the time from receiving it
  // to this u.
  bool has_exchange = false;
  PeerTime s{};
  Duration h{};
  // Acknowledgement. largest = 0: nothing has arrived. Bit i of bitmap: packet largest - 1 - i has
  // arrived.
  std::uint64_t largest = 0;
  AckBitmap bitmap{};
  // Dispersion of the newest train of back-to-back packets: it began with packet train_start; the
  // packets after the first came in at train_rate.
  std::uint64_t train_start = 0;
  std::uint32_t train_packets = 0;
  DataRate train_rate{};  // on the wire in kbit/s
  friend bool operator==(const LinkReport&, const LinkReport&) = default;
};

inline constexpr std::size_t kMaxReports = 8;
inline constexpr std::size_t kReportBytes = 76;
// The size of a feedback packet.
constexpr std::size_t feedback_bytes(std::size_t reports) {
  return kPacketOverhead + 16 + reports * kReportBytes;
}

struct Feedback {
  std::int64_t u = 0;  // send instant, the sender's clock
  SessionId echo{};    // the receiver's session as the sender has heard it; 0: not heard yet
  std::vector<LinkReport> reports;
  friend bool operator==(const Feedback&, const Feedback&) = default;
};

struct Data {
  FragmentHeader fragment;
  ByteView bytes;  // into the parsed datagram
};

struct Packet {
  PacketHeader header;
  // Exactly the member that header.type names is meaningful.
  Data data;
  Feedback feedback;
};

std::optional<Packet> parse(ByteView datagram);

// Each writes one datagram and returns its size; the buffer must hold it (asserted: our own bug).
std::size_t write_data(std::span<std::byte> out, const PacketHeader& header,
                       const FragmentHeader& fragment, ByteView bytes);
std::size_t write_feedback(std::span<std::byte> out, const PacketHeader& header,
                           const Feedback& feedback);
// Padded to `size` bytes, at least kPacketOverhead.
std::size_t write_probe(std::span<std::byte> out, const PacketHeader& header, std::size_t size);

}  // namespace interneuron::wire
