// Packets <-> bytes. docs/wire_format.md is the authority.
//
// A packet is one UDP payload: header (20 bytes), body, tag (16 bytes). Epoch 0 means that the
// packet is not encrypted: its tag is all zero and anything else is malformed. Packets of epoch 1
// are sealed and opened by crypto::Session (src/core/secure/), which the session in the header
// tells the keys; parse_opened() reads what it has opened. Any other epoch is malformed.
//
// parse() is where a peer's bytes enter the core, so everything behind it relies on what it checks:
// the datagram is at most kMaxDatagramBytes long, every size and count is within its bound, every
// enumerator is one that exists, reserved bits are zero. Only the packet's type may be one that
// this version does not use: such a packet counts as arrived, and nothing of its body is read. What
// parse() cannot check are lies: numbers, times and rates are the sender's word, and in the clear
// anybody on the path may write them. It never throws and does not allocate. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "core/wire/feedback.h"
#include "core/wire/header.h"
#include "core/wire/stamp.h"
#include "core/wire/window.h"
#include "interneuron/units.h"

namespace interneuron::wire {

struct Data {
  FragmentHeader fragment;
  // Points into the parsed datagram.
  ByteView bytes;
};

// What proves that whoever asks receives what is sent to the address that it asks from: bytes that
// only the side that made them can tell from others (core/peers/address_validation.h).
inline constexpr std::size_t kTokenBytes = 16;
using Token = std::array<std::byte, kTokenBytes>;

// What `interneuron probe` measures with: a STAMP test packet (RFC 8762) in our own envelope, so
// that a roadside unit answers on its normal port. The answer has the size of the request.
inline constexpr std::size_t kMaxEchoTrain = 256;
inline constexpr std::size_t kEchoBytes = kPacketOverhead + 8 + kStampBytes + kTokenBytes;

struct Echo {
  bool is_reply = false;
  // The replies of a train wait for each other and leave back to back, so that their dispersion
  // tells the rate of the way back.
  bool hold = false;
  // Seconds after which the reply is wanted; 0 in a train.
  std::uint8_t delay = 0;
  // The train's number, this packet's place in it (0 … count - 1) and its packets
  // (2 … kMaxEchoTrain); all 0 in no train.
  std::uint16_t train = 0;
  std::uint16_t index = 0;
  std::uint16_t count = 0;
  // Only the one that is_reply names has a meaning.
  StampRequest request;
  StampReply reply;
  // In a reply it proves the address that the reply goes to; in a request it is that of a reply to
  // an earlier one, without which nothing is held or delayed.
  Token token{};
};

// The answer to a packet from an address that is not proved. It has the path and the number of that
// packet, and is none of the sender's numbered packets.
struct Challenge {
  // The session of the packet that is answered.
  SessionId echo{};
  Token token{};
  friend bool operator==(const Challenge&, const Challenge&) = default;
};

struct Packet {
  // Leaves what is no default alone: all of it to be zeroed would be 1.9 KB for every datagram.
  Packet() {}
  PacketHeader header;
  // Only the member that header.type names has a meaning; a probe and a packet of a type that is
  // not used have none.
  Data data;
  Feedback feedback;
  Echo echo;
  Window window;
  Challenge challenge;
  // What a packet of type kToken brings.
  Token token{};
};

// The packet that these bytes are, or nothing if they are malformed or sealed.
std::optional<Packet> parse(ByteView datagram);
// What stands before the tag of a packet that is not sealed, for parse_opened(); nothing if it
// cannot be one.
std::optional<ByteView> without_tag(ByteView datagram);
// The same of a packet that was sealed and is opened now, without its tag. Whatever its epoch is.
std::optional<Packet> parse_opened(ByteView packet);
// The version of the format that a datagram seems to follow where it is not ours: of any bytes that
// parse() refuses. Only a guess, to tell people why nothing works. Nothing: no version is known
// that looks like this.
std::optional<std::uint8_t> other_version(ByteView datagram);

// Each writes one datagram and returns its size in bytes. The buffer must hold it, which is
// asserted. The bytes of a fragment may come in two parts.
std::size_t write_data(std::span<std::byte> out, const PacketHeader& header,
                       const FragmentHeader& fragment, ByteView bytes, ByteView more = {});
// What stands before the bytes of a message's payload and, right behind it in the buffer, what
// stands after them: a data packet whose payload is not copied. `bytes`: of the message's header.
struct DataEnds {
  std::size_t head = 0;
  std::size_t tail = 0;
};
DataEnds write_data_ends(std::span<std::byte> out, const PacketHeader& header,
                         const FragmentHeader& fragment, ByteView bytes);
std::size_t write_window(std::span<std::byte> out, const PacketHeader& header,
                         const WindowHeader& window, ByteView bytes);
std::size_t write_feedback(std::span<std::byte> out, const PacketHeader& header,
                           const Feedback& feedback);
// Padded to `size` bytes, at least kPacketOverhead.
std::size_t write_probe(std::span<std::byte> out, const PacketHeader& header, std::size_t size);
// Padded to `size` bytes, at least kEchoBytes.
std::size_t write_echo(std::span<std::byte> out, const PacketHeader& header, const Echo& echo,
                       std::size_t size);
std::size_t write_challenge(std::span<std::byte> out, const PacketHeader& header,
                            const Challenge& challenge);
std::size_t write_token(std::span<std::byte> out, const PacketHeader& header, const Token& token);

}  // namespace interneuron::wire
