// What "a parsed packet is always valid" means: every rule of docs/wire_format.md, and that writing
// the value gives exactly the bytes it was parsed from, so that no bytes are silently ignored. For
// tests and the fuzzer.
#pragma once

#include <algorithm>

#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"

namespace interneuron::wire {

inline Bytes written(const Packet& packet, std::size_t size) {
  Bytes out(std::max<std::size_t>(size, 2048));
  const PacketHeader& header = packet.header;
  std::size_t used = 0;
  if (header.type == PacketType::kData) {
    used = write_data(out, header, packet.data.fragment, packet.data.bytes);
  } else if (header.type == PacketType::kFeedback) {
    used = write_feedback(out, header, packet.feedback);
  } else if (header.type == PacketType::kWindow) {
    used = write_window(out, header, packet.window.header, packet.window.bytes);
  } else if (header.type == PacketType::kEcho) {
    used = write_echo(out, header, packet.echo, size);
  } else {
    used = write_probe(out, header, size);
  }
  out.resize(used);
  return out;
}

inline bool is_consistent(const Data& data, ByteView datagram) {
  const FragmentHeader& f = data.fragment;
  const std::uint64_t count = (std::uint64_t{f.size} + f.chunk - 1) / f.chunk;
  const bool inside = data.bytes.data() >= datagram.data() &&
                      data.bytes.data() + data.bytes.size() <= datagram.data() + datagram.size();
  const bool is_repair = f.index >= count;
  const std::uint64_t end = std::uint64_t{f.index} * f.chunk + data.bytes.size();
  const bool fits =
      is_repair || f.index + 1U < count ? data.bytes.size() == f.chunk : end == f.size;
  const std::uint64_t blocks = (count + 199) / 200;
  const bool has_row = f.index < count + 55 * blocks;
  return inside && fits && has_row && f.size > 0 && f.chunk > 0 && count <= UINT16_MAX &&
         !data.bytes.empty() && f.kind <= kLastKind;
}

inline bool is_consistent(const Feedback& feedback) {
  return feedback.reports.size() <= kMaxReports && feedback.complete.size() <= kMaxComplete &&
         feedback.refused.size() <= kMaxRefused &&
         std::ranges::all_of(feedback.reports, [](const LinkReport& report) {
           return report.h >= Duration::zero() && report.train_rate >= DataRate{} &&
                  report.rate >= DataRate{};
         });
}

inline bool is_consistent(const Window& window) {
  const WindowHeader& h = window.header;
  const std::size_t bytes = window.bytes.size();
  return h.row < 55 && !h.messages.empty() && h.messages.size() <= kMostWindowMessages &&
         h.sources() <= 32 && bytes >= 12 && bytes <= 1411 &&
         std::ranges::all_of(h.messages, [](const auto& covered) { return covered.pieces != 0; });
}

// What must be zero inside a STAMP packet, and what pads it, is ignored when read: what was read
// must come back.
inline bool is_consistent(const Echo& echo, ByteView again) {
  const auto read = parse(again);
  if (!read || read->header.type != PacketType::kEcho) return false;
  const Echo& e = read->echo;
  const bool in_train = echo.train != 0 && echo.count >= 2 && echo.count <= kMaxEchoTrain &&
                        echo.index < echo.count && echo.delay == 0;
  const bool alone = echo.train == 0 && echo.count == 0 && echo.index == 0 && !echo.hold;
  return (in_train || alone) && e.is_reply == echo.is_reply && e.hold == echo.hold &&
         e.delay == echo.delay && e.train == echo.train && e.index == echo.index &&
         e.count == echo.count && e.request == echo.request && e.reply == echo.reply;
}

// `packet` as parse(datagram) gave it.
inline bool is_consistent(const Packet& packet, ByteView datagram) {
  const PacketHeader& h = packet.header;
  if (static_cast<std::uint8_t>(h.type) == 0 || h.epoch != kClearEpoch || h.session.value == 0 ||
      h.number == 0)
    return false;
  const Bytes again = written(packet, datagram.size());
  switch (h.type) {
    case PacketType::kData:
      return is_consistent(packet.data, datagram) && std::ranges::equal(again, datagram);
    case PacketType::kFeedback:
      return is_consistent(packet.feedback) && std::ranges::equal(again, datagram);
    case PacketType::kWindow:
      return is_consistent(packet.window) && std::ranges::equal(again, datagram);
    case PacketType::kProbe:  // the padding is ignored, and so are the bodies of unused types
    case PacketType::kInitiation:
    case PacketType::kResponse:
    case PacketType::kCookie:
    default:
      return again.size() == datagram.size() &&
             std::ranges::equal(ByteView(again).first(kHeaderBytes), datagram.first(kHeaderBytes));
    case PacketType::kEcho:
      return again.size() == datagram.size() && is_consistent(packet.echo, again) &&
             std::ranges::equal(ByteView(again).first(kHeaderBytes), datagram.first(kHeaderBytes));
  }
}

// `header` as parse_round_header(message) gave it.
inline bool is_consistent(const RoundHeader& header, ByteView message) {
  const auto known = [](RoundState s) { return s <= RoundState::kMissed; };
  if (header.stages < 1 || header.stages > kMaxStages || !header.is_communication(header.stage) ||
      header.variant >= kMaxVariants || header.best_planned > header.variant ||
      header.round.origin.value == 0 || header.deadline() <= Duration::zero() ||
      header.x_permille < -1000 || header.guard > GuardKind::kBudget ||
      (header.variant_used >= kMaxVariants && header.variant_used != kNoneUsed) ||
      header.message_class > MessageClass::kResult ||
      !std::ranges::all_of(header.indicator, known)) {
    return false;
  }
  std::array<std::byte, kRoundHeaderBytes> again{};
  write_round_header(again, header);
  return std::ranges::equal(again, message.first(kRoundHeaderBytes));
}

// The property itself: bytes are refused, or they mean something valid.
inline bool refused_or_consistent(ByteView datagram) {
  const auto packet = parse(datagram);
  return !packet || is_consistent(*packet, datagram);
}

inline bool refused_or_consistent_message(ByteView message) {
  const auto header = parse_round_header(message);
  return !header || is_consistent(*header, message);
}

inline bool refused_or_consistent_plain(ByteView message) {
  const auto header = parse_plain_header(message);
  if (!header) return true;
  if (header->deadline_us == 0 || header->variant >= kMaxVariants) return false;
  std::array<std::byte, kMostPlainHeaderBytes> again{};
  write_plain_header(again, *header);
  const std::size_t size = header->bytes();
  return std::ranges::equal(ByteView(again).first(size), message.first(size));
}

// The bytes with another value at one place.
inline Bytes with(Bytes bytes, std::size_t at, int value) {
  bytes.at(at) = static_cast<std::byte>(value);
  return bytes;
}

}  // namespace interneuron::wire
