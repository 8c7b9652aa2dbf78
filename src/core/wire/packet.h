// Packets <-> bytes. docs/wire_format.md is the authority.
//
// A packet is one UDP payload: header (20 bytes), body, tag (16 bytes). Epoch 0 means that the
// packet is not encrypted: its tag is all zero and anything else is malformed. Packets of epoch 1
// are sealed and opened by crypto::Session (src/core/secure/), which the
// session in the header tells the keys; parse_opened() reads what it has opened. Any other epoch is
// malformed.
//
// parse() is where a peer's bytes enter the core, so everything behind it relies on what it checks:
// the datagram is at most kMaxDatagramBytes long, every size and count is within its bound, every
// enumerator is one that exists, reserved bits are zero. Only the packet's type may be one that
// this version does not use: such a packet counts as arrived, and nothing of its body is read. What
// parse() cannot check are lies: numbers, times and rates are the sender's word, and in the clear
// anybody on the path may write them. It never throws and does not allocate. Pure.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "core/wire/stamp.h"
#include "core/wire/window.h"
#include "interneuron/few.h"
#include "interneuron/sizes.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::wire {

// The version of this format, in the upper half of a packet's first byte. Version 1 had the type
// alone there.
inline constexpr std::uint8_t kVersion = 2;

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
// Of the header: what is authenticated and not encrypted. The stamp behind it is encrypted.
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

  // Of a fragment that parse() gave, 1 … 65,535.
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

// How many packets before the largest one an acknowledgement tells of. A receiver reports after 16
// packets at the latest (src/core/peers/feedback_due.h), so that 15 reports in a row may be lost
// before an arrival stays untold.
inline constexpr std::size_t kAckWindow = 256;
using AckBitmap = std::array<std::uint64_t, kAckWindow / 64>;

// What the sender of the feedback has seen on one link.
struct LinkReport {
  LinkId link{};
  // Clock exchange (docs/paper.md, "Clock offset"): s is the newest u received on this link, h the
  // time from receiving it to this u.
  bool has_exchange = false;
  PeerTime s{};
  Duration h{};
  // Acknowledgement: the largest packet number that has arrived, 0 for none, and which of the
  // packets before it have; bit i stands for packet largest - 1 - i.
  std::uint64_t largest = 0;
  AckBitmap bitmap{};
  // Dispersion of the newest train of back-to-back packets: it began with packet train_start and
  // has had train_packets so far; those after the first came in at train_rate (IP headers included,
  // on the wire in kbit/s).
  std::uint64_t train_start = 0;
  std::uint32_t train_packets = 0;
  DataRate train_rate{};
  // What the sender of the feedback believes of its own direction on this link. The rate is 0 while
  // it is not known (on the wire in kbit/s); the loss is the share of packets lost, in 1/65535.
  DataRate rate{};
  std::uint16_t loss = 0;
  // It pays per byte on this link, so we measure it with as few bytes as possible.
  bool metered = false;
  // The delays of packets with data or padding: receive instant by its clock less the packet's
  // stamp, in microseconds modulo 2^32, so that only differences of two delays mean anything.
  // Of the newest such packet, and the largest since the report before.
  bool has_delays = false;
  std::uint32_t newest_delay_us = 0;
  std::uint32_t largest_delay_us = 0;
  // What has arrived on this path so far: packets marked ECT(0) or ECT(1) and packets marked CE
  // (RFC 3168), both modulo 2^32, and bytes with IP and UDP headers.
  std::uint32_t ect_packets = 0;
  std::uint32_t ce_packets = 0;
  std::uint64_t received_bytes = 0;
  friend bool operator==(const LinkReport&, const LinkReport&) = default;
};

inline constexpr std::size_t kMaxReports = 8;
inline constexpr std::size_t kReportBytes = 105;

// A message that is complete at the sender of the feedback.
struct CompleteMessage {
  MessageId message{};
  // How long before `u` it became so, in microseconds; kLongestAgo: that long or longer.
  std::uint32_t ago_us = 0;
  // It was dropped there: it was too late, or of a channel on which a newer one was delivered.
  bool dropped = false;
  friend bool operator==(const CompleteMessage&, const CompleteMessage&) = default;
};
// The largest value of 31 bits, 35.8 minutes.
inline constexpr std::uint32_t kLongestAgo = 0x7fff'ffff;
// As many as fit beside kMaxReports reports into the smallest datagram (kMinDatagramBytes of
// src/core/peers/peers.cc).
inline constexpr std::size_t kMaxComplete = 32;
inline constexpr std::size_t kMaxRefused = 16;
inline constexpr std::size_t kCompleteBytes = 8;
inline constexpr std::size_t kRefusedBytes = 4;

inline constexpr std::size_t kFeedbackBodyBytes = 17;
// The size of a feedback packet.
constexpr std::size_t feedback_bytes(std::size_t reports, std::size_t complete = 0,
                                     std::size_t refused = 0) {
  return kPacketOverhead + kFeedbackBodyBytes + reports * kReportBytes + complete * kCompleteBytes +
         refused * kRefusedBytes;
}

// What the sender of a feedback can do: decode the symbols of windows.
inline constexpr std::uint16_t kDecodesWindows = 0x0001;

// Held in place, so that feedback is written and parsed without allocating.
using LinkReports = Few<LinkReport, kMaxReports>;

// What a peer tells regularly over each path: acknowledgements, its half of the clock exchange, and
// what it has measured. Also the heartbeat of an idle path.
struct Feedback {
  // When it left, ns on the sender's clock.
  std::int64_t u = 0;
  // The receiver's session as the sender has heard it; 0 while it has not.
  SessionId echo{};
  // What the sender of the feedback can do beyond this version's least; bits that are not known
  // are ignored.
  std::uint16_t features = 0;
  LinkReports reports;
  // Messages that became complete lately, of which nothing more need be sent, and messages of which
  // a piece came lately for which there was no room.
  Few<CompleteMessage, kMaxComplete> complete;
  Few<MessageId, kMaxRefused> refused;
  friend bool operator==(const Feedback&, const Feedback&) = default;
};

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
  // Of a reply: what proves the address that it goes to. Of a request: that of a reply to an
  // earlier one, without which nothing is held or delayed.
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
  PacketHeader header;
  // Only the member that header.type names has a meaning; a probe and a packet of a type that is
  // not used have none.
  Data data;
  Feedback feedback;
  Echo echo;
  Window window;
  Challenge challenge;
  // Of a packet of type kToken.
  Token token{};
};

// The packet that these bytes are, or nothing if they are malformed or sealed.
std::optional<Packet> parse(ByteView datagram);
// What stands before the tag of a packet that is not sealed, for parse_opened(); nothing if it cannot
// be one.
std::optional<ByteView> without_tag(ByteView datagram);
// The same of a packet that was sealed and is opened now, without its tag. Whatever its epoch is.
std::optional<Packet> parse_opened(ByteView packet);
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
