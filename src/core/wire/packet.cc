#include "core/wire/packet.h"

#include <algorithm>
#include <cassert>

#include "core/code/blocks.h"
#include "core/wire/bytes.h"

namespace interneuron::wire {
namespace {

// Where the version begins in a packet's first byte, and which bits of it are the type.
constexpr unsigned kVersionShift = 4;
constexpr std::uint8_t kTypeMask = 0x0f;
// The smallest packet of version 1, and so of all versions.
constexpr std::size_t kFewestBytes = 32;
// The largest number of pieces that an index of 16 bits allows.
constexpr std::uint64_t kMaxPieces = UINT16_MAX;
// Flags of an echo.
constexpr std::uint8_t kIsReply = 0x01;
constexpr std::uint8_t kHold = 0x02;

void put_header(Writer& w, const PacketHeader& h) {
  w.put(static_cast<std::uint8_t>(kVersion << kVersionShift | static_cast<std::uint8_t>(h.type)));
  w.put(h.epoch);
  w.put(h.link.value);
  w.put(h.session.value);
  w.put(h.number);
  w.put(h.stamp_us);
}

// Where the epoch and the session stand in a packet.
constexpr std::size_t kEpochAt = 1;
constexpr std::size_t kSessionAt = 4;
constexpr std::size_t kNumberAt = 8;

std::optional<PacketHeader> get_header(Reader& r) {
  PacketHeader h;
  const auto first = r.get<std::uint8_t>();
  h.epoch = r.get<std::uint8_t>();
  h.link = LinkId{r.get<std::uint16_t>()};
  h.session = SessionId{r.get<std::uint32_t>()};
  h.number = r.get<std::uint64_t>();
  h.stamp_us = r.get<std::uint32_t>();
  const auto type = static_cast<std::uint8_t>(first & kTypeMask);
  if (!r.ok() || first >> kVersionShift != kVersion || type == 0 || h.epoch > kSealedEpoch ||
      h.session.value == 0 || h.number == 0) {
    return std::nullopt;
  }
  h.type = static_cast<PacketType>(type);
  return h;
}

void put_fragment(Writer& w, const FragmentHeader& f) {
  w.put(f.message.value);
  w.put(f.size);
  w.put(f.chunk);
  w.put(f.index);
  w.put(f.lifetime_us);
  w.put(static_cast<std::uint8_t>(f.kind));
}

std::optional<Data> get_data(Reader& r) {
  Data d;
  FragmentHeader& f = d.fragment;
  f.message = MessageId{r.get<std::uint32_t>()};
  f.size = r.get<std::uint32_t>();
  f.chunk = r.get<std::uint16_t>();
  f.index = r.get<std::uint16_t>();
  f.lifetime_us = r.get<std::uint32_t>();
  const auto kind = r.get<std::uint8_t>();
  if (!r.ok() || f.size == 0 || f.chunk == 0 || f.size > kMaxPieces * f.chunk ||
      kind > static_cast<std::uint8_t>(kLastKind)) {
    return std::nullopt;
  }
  f.kind = static_cast<MessageKind>(kind);
  if (f.index >= code::Blocks(f.count()).end()) return std::nullopt;
  d.bytes = r.rest();
  if (d.bytes.size() != f.bytes()) return std::nullopt;
  return d;
}

std::optional<Echo> get_echo(Reader& r) {
  Echo e;
  const auto flags = r.get<std::uint8_t>();
  e.delay = r.get<std::uint8_t>();
  e.train = r.get<std::uint16_t>();
  e.index = r.get<std::uint16_t>();
  e.count = r.get<std::uint16_t>();
  e.is_reply = (flags & kIsReply) != 0;
  e.hold = (flags & kHold) != 0;
  const bool alone = e.train == 0 && e.index == 0 && e.count == 0 && !e.hold;
  const bool in_train =
      e.train != 0 && e.count >= 2 && e.count <= kMaxEchoTrain && e.index < e.count && e.delay == 0;
  if (!r.ok() || (flags & ~(kIsReply | kHold)) != 0 || (!alone && !in_train)) {
    return std::nullopt;
  }
  if (e.is_reply) {
    const auto reply = get_stamp_reply(r);
    if (!reply) return std::nullopt;
    e.reply = *reply;
  } else {
    const auto request = get_stamp_request(r);
    if (!request) return std::nullopt;
    e.request = *request;
  }
  for (std::byte& byte : e.token) byte = std::byte{r.get<std::uint8_t>()};
  if (!r.ok()) return std::nullopt;
  return e;
}

bool get_token(Reader& r, Token& token) {
  const ByteView bytes = r.rest();
  if (!r.ok() || bytes.size() != token.size()) return false;
  std::ranges::copy(bytes, token.begin());
  return true;
}

bool is_zero(ByteView bytes) {
  // Without a way out half way the compiler looks at many bytes at a time.
  std::byte any{0};
  for (const std::byte b : bytes) any |= b;
  return any == std::byte{0};
}

void put_keys(std::span<std::byte> packet, std::uint8_t epoch, SessionId session) {
  packet[kEpochAt] = std::byte{epoch};
  Writer w(packet.subspan(kSessionAt));
  w.put(session.value);
  assert(w.ok());
}

std::size_t finish(Writer& w) {
  w.put_zeros(kTagBytes);
  assert(w.ok());
  return w.size();
}

}  // namespace

std::optional<ByteView> without_tag(ByteView datagram) {
  if (datagram.size() < kPacketOverhead || datagram.size() > kMaxDatagramBytes) return std::nullopt;
  if (datagram[kEpochAt] != std::byte{kClearEpoch}) return std::nullopt;
  if (!is_zero(datagram.last(kTagBytes))) return std::nullopt;
  return datagram.first(datagram.size() - kTagBytes);
}

std::optional<Packet> parse(ByteView datagram) {
  const auto packet = without_tag(datagram);
  return packet ? parse_opened(*packet) : std::nullopt;
}

std::optional<PacketHeader> peek(ByteView datagram) {
  if (datagram.size() < kPacketOverhead || datagram.size() > kMaxDatagramBytes) return std::nullopt;
  Reader r(datagram);
  return get_header(r);
}

void mark_sealed(std::span<std::byte> packet, SessionId session) {
  put_keys(packet, kSealedEpoch, session);
}

void mark_clear(std::span<std::byte> packet, SessionId session) {
  put_keys(packet, kClearEpoch, session);
}

void set_number(std::span<std::byte> packet, std::uint64_t number) {
  Writer w(packet.subspan(kNumberAt));
  w.put(number);
  assert(w.ok());
}

void write_header(std::span<std::byte> out, const PacketHeader& header) {
  Writer w(out);
  put_header(w, header);
  assert(w.ok());
}

std::optional<Packet> parse_opened(ByteView bytes) {
  Reader r(bytes);
  const auto header = get_header(r);
  if (!header) return std::nullopt;
  std::optional<Packet> parsed(std::in_place);
  Packet& packet = *parsed;
  packet.header = *header;
  switch (header->type) {
    case PacketType::kData: {
      const auto data = get_data(r);
      if (!data) return std::nullopt;
      packet.data = *data;
      return parsed;
    }
    case PacketType::kFeedback:
      if (!get_feedback(r, packet.feedback)) return std::nullopt;
      return parsed;
    case PacketType::kEcho: {
      const auto echo = get_echo(r);
      if (!echo) return std::nullopt;
      packet.echo = *echo;
      return parsed;
    }
    case PacketType::kWindow: {
      const auto window = get_window(r);
      if (!window) return std::nullopt;
      packet.window = *window;
      return parsed;
    }
    case PacketType::kChallenge:
      packet.challenge.echo = SessionId{r.get<std::uint32_t>()};
      if (!get_token(r, packet.challenge.token)) return std::nullopt;
      return parsed;
    case PacketType::kToken:
      if (!get_token(r, packet.token)) return std::nullopt;
      return parsed;
    // What pads a probe, and the body of a type that is not used, is not read.
    case PacketType::kProbe:
    case PacketType::kInitiation:
    case PacketType::kResponse:
    case PacketType::kCookie:
      break;
  }
  return parsed;
}

std::optional<std::uint8_t> other_version(ByteView datagram) {
  // Every version has the session, which is not 0, at bytes 4 … 7 and the number, which is not 0,
  // at 8 … 15, and speaks in the clear until it was answered: then the tag is all zero.
  const bool is_clear = datagram.size() >= kFewestBytes && !is_zero(datagram.subspan(4, 4)) &&
                        !is_zero(datagram.subspan(8, 8)) && is_zero(datagram.last(kTagBytes));
  if (!is_clear) return std::nullopt;
  const auto first = std::to_integer<std::uint8_t>(datagram.front());
  const auto version = static_cast<std::uint8_t>(first >> kVersionShift);
  const auto type = static_cast<std::uint8_t>(first & kTypeMask);
  if (version > 1 && version != kVersion) {
    const bool is_plausible =
        datagram.size() >= kPacketOverhead && type != 0 && is_zero(datagram.subspan(1, 1));
    return is_plausible ? std::optional(version) : std::nullopt;
  }
  // Version 1: the type, the path, two bytes of 0.
  const bool looks_like_1 =
      version == 0 && type >= 1 && type <= 4 && is_zero(datagram.subspan(2, 2));
  return looks_like_1 ? std::optional<std::uint8_t>(1) : std::nullopt;
}

std::size_t write_data(std::span<std::byte> out, const PacketHeader& header,
                       const FragmentHeader& fragment, ByteView bytes, ByteView more) {
  Writer w(out);
  put_header(w, header);
  put_fragment(w, fragment);
  w.put_bytes(bytes);
  w.put_bytes(more);
  return finish(w);
}

DataEnds write_data_ends(std::span<std::byte> out, const PacketHeader& header,
                         const FragmentHeader& fragment, ByteView bytes) {
  Writer w(out);
  put_header(w, header);
  put_fragment(w, fragment);
  w.put_bytes(bytes);
  const std::size_t head = w.size();
  return {head, finish(w) - head};
}

std::size_t write_window(std::span<std::byte> out, const PacketHeader& header,
                         const WindowHeader& window, ByteView bytes) {
  Writer w(out);
  put_header(w, header);
  put_window(w, window);
  w.put_bytes(bytes);
  return finish(w);
}

std::size_t write_feedback(std::span<std::byte> out, const PacketHeader& header,
                           const Feedback& feedback) {
  Writer w(out);
  put_header(w, header);
  put_feedback(w, feedback);
  return finish(w);
}

std::size_t write_probe(std::span<std::byte> out, const PacketHeader& header, std::size_t size) {
  Writer w(out);
  put_header(w, header);
  w.put_zeros(std::max(size, kPacketOverhead) - kPacketOverhead);
  return finish(w);
}

std::size_t write_echo(std::span<std::byte> out, const PacketHeader& header, const Echo& echo,
                       std::size_t size) {
  Writer w(out);
  put_header(w, header);
  w.put(static_cast<std::uint8_t>((echo.is_reply ? kIsReply : 0) | (echo.hold ? kHold : 0)));
  w.put(echo.delay);
  w.put(echo.train);
  w.put(echo.index);
  w.put(echo.count);
  if (echo.is_reply) {
    put_stamp(w, echo.reply);
  } else {
    put_stamp(w, echo.request);
  }
  w.put_bytes(echo.token);
  w.put_zeros(std::max(size, kEchoBytes) - kEchoBytes);
  return finish(w);
}

std::size_t write_challenge(std::span<std::byte> out, const PacketHeader& header,
                            const Challenge& challenge) {
  Writer w(out);
  put_header(w, header);
  w.put(challenge.echo.value);
  w.put_bytes(challenge.token);
  return finish(w);
}

std::size_t write_token(std::span<std::byte> out, const PacketHeader& header, const Token& token) {
  Writer w(out);
  put_header(w, header);
  w.put_bytes(token);
  return finish(w);
}

}  // namespace interneuron::wire
