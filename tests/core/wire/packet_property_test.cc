// What holds for every packet and every round header.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/wire/message_bytes.h"
#include "tests/core/wire/consistent.h"

namespace interneuron::wire::packet_property_test {
namespace {

constexpr std::size_t kRoom = 4096;

template <class T>
T any() {
  return *rc::gen::resize(100, rc::gen::arbitrary<T>());
}

template <class T>
T any_but_zero() {
  return *rc::gen::resize(100, rc::gen::nonZero<T>());
}

PacketHeader any_header(PacketType type) {
  return {type,
          LinkId{any<std::uint16_t>()},
          kClearEpoch,
          SessionId{any_but_zero<std::uint32_t>()},
          any_but_zero<std::uint64_t>(),
          any<std::uint32_t>()};
}

// Indices of a message of so many pieces and its repair symbols are below this.
std::uint32_t end_of(std::uint32_t count) {
  return std::min(65536U, count + (count + 199) / 200 * 55);
}

struct Piece {
  FragmentHeader fragment;
  Bytes bytes;

  Piece() {
    fragment.message = MessageId{any<std::uint32_t>()};
    fragment.chunk = *rc::gen::inRange<std::uint16_t>(1, kMaxPieceBytes + 1);
    const auto count = *rc::gen::inRange<std::uint32_t>(1, 65536);
    const auto last = *rc::gen::inRange<std::uint32_t>(1, fragment.chunk + 1U);
    fragment.size = (count - 1) * fragment.chunk + last;
    fragment.lifetime_us = any<std::uint32_t>();
    if (any<bool>()) fragment.kind = MessageKind::kPlain;
    const bool is_last = any<bool>();
    fragment.index = static_cast<std::uint16_t>(
        is_last ? count - 1 : *rc::gen::inRange<std::uint32_t>(0, end_of(count)));
    const std::size_t size = fragment.bytes();
    const auto fill = any<std::uint8_t>();
    for (std::size_t i = 0; i < size; ++i) bytes.push_back(static_cast<std::byte>(fill + 31 * i));
  }
};

Feedback any_feedback() {
  Feedback f;
  f.u = any<std::int64_t>();
  f.echo = SessionId{any<std::uint32_t>()};
  const auto count = *rc::gen::inRange<std::size_t>(0, kMaxReports + 1);
  for (std::size_t i = 0; i < count; ++i) f.reports.push_back({});
  for (LinkReport& report : f.reports) {
    report.link = LinkId{any<std::uint16_t>()};
    report.has_exchange = any<bool>();
    report.s = PeerTime{Duration{any<std::int64_t>()}};
    report.h = Duration{any<std::int64_t>() & INT64_MAX};
    report.largest = any<std::uint64_t>();
    for (std::uint64_t& word : report.bitmap) word = any<std::uint64_t>();
    report.train_start = any<std::uint64_t>();
    report.train_packets = any<std::uint32_t>();
    report.train_rate = {std::int64_t{any<std::uint32_t>()} * 1000};
    report.rate = {std::int64_t{any<std::uint32_t>()} * 1000};
    report.loss = any<std::uint16_t>();
    report.metered = any<bool>();
    report.has_delays = any<bool>();
    report.newest_delay_us = any<std::uint32_t>();
    report.largest_delay_us = any<std::uint32_t>();
    report.ect0_packets = any<std::uint16_t>();
    report.ect1_packets = any<std::uint32_t>();
    report.ce_packets = any<std::uint32_t>();
    report.received_bytes = any<std::uint64_t>();
  }
  f.features = any<std::uint16_t>();
  for (auto n = *rc::gen::inRange<std::size_t>(0, kMaxComplete + 1); n > 0; --n) {
    const bool dropped = any<bool>();
    f.complete.push_back({MessageId{any<std::uint32_t>()}, any<std::uint32_t>() & kLongestAgo,
                          dropped, !dropped && any<bool>()});
  }
  for (auto n = *rc::gen::inRange<std::size_t>(0, kMaxRefused + 1); n > 0; --n) {
    f.refused.push_back({any<std::uint32_t>()});
  }
  return f;
}

RoundHeader any_round_header() {
  RoundHeader h;
  h.round = {SessionId{any_but_zero<std::uint32_t>()}, PipelineId{any<std::uint8_t>()},
             RoundId{any<std::uint32_t>()}};
  h.stages = *rc::gen::inRange<std::uint8_t>(1, kMaxStages + 1);
  h.stage = static_cast<std::uint8_t>(*rc::gen::inRange<int>(1, h.stages + 1));
  h.communication = static_cast<std::uint16_t>(any<std::uint16_t>() | (1U << (h.stage - 1)));
  h.variant = *rc::gen::inRange<std::uint8_t>(0, kMaxVariants);
  h.best_planned = static_cast<std::uint8_t>(*rc::gen::inRange<int>(0, h.variant + 1));
  h.degraded = any<bool>();
  h.message_class = any<bool>() ? MessageClass::kResult : MessageClass::kData;
  for (std::uint8_t& need : h.needs) need = any<std::uint8_t>();
  h.policy = any<std::uint32_t>();
  h.t0 = PeerTime{Duration{any<std::int64_t>()}};
  h.alpha_sum = Duration{any<std::int64_t>()};
  h.x_permille = static_cast<std::int16_t>(*rc::gen::inRange<int>(-1000, INT16_MAX + 1));
  h.deadline_us = any_but_zero<std::uint32_t>();
  h.period_us = any<std::uint32_t>();
  for (RoundState& state : h.indicator) {
    state = static_cast<RoundState>(*rc::gen::inRange<int>(0, 3));
  }
  h.guard = any<bool>() ? GuardKind::kBudget : GuardKind::kPaper;
  h.level_used = any<std::uint8_t>();
  h.variant_used = any<bool>() ? kNoneUsed : *rc::gen::inRange<std::uint8_t>(0, kMaxVariants);
  h.local_quality = any<std::uint8_t>();
  h.miss_price = any<std::uint16_t>();
  h.excess = any<std::int16_t>();
  h.computed = any<std::uint16_t>();
  for (std::uint16_t& e2e : h.e2e) e2e = any<std::uint16_t>();
  return h;
}

StampRequest any_request() {
  return {any<std::uint32_t>(), any<std::uint64_t>(),
          static_cast<std::uint16_t>(any<std::uint16_t>() | 1U)};
}

StampReply any_reply() {
  StampReply reply = stamp_reply_to(any_request(), any<std::uint8_t>());
  reply.sequence = any<std::uint32_t>();
  reply.sent = any<std::uint64_t>();
  reply.received = any<std::uint64_t>();
  reply.error_estimate = static_cast<std::uint16_t>(any<std::uint16_t>() | 1U);
  return reply;
}

Echo any_echo() {
  Echo echo;
  echo.is_reply = any<bool>();
  if (any<bool>()) {
    echo.hold = any<bool>();
    echo.train = any_but_zero<std::uint16_t>();
    echo.count = *rc::gen::inRange<std::uint16_t>(2, kMaxEchoTrain + 1);
    echo.index = *rc::gen::inRange<std::uint16_t>(0, echo.count);
  } else {
    echo.delay = any<std::uint8_t>();
  }
  if (echo.is_reply) {
    echo.reply = any_reply();
  } else {
    echo.request = any_request();
  }
  return echo;
}

struct Symbol {
  WindowHeader header;
  Bytes bytes;

  Symbol() {
    header.row = *rc::gen::inRange<std::uint8_t>(0, code::kMostRows);
    auto message = any<std::uint32_t>();
    const auto messages = *rc::gen::inRange<int>(1, kMostWindowMessages + 1);
    const int most = static_cast<int>(code::kMostSources) / messages;
    for (int i = 0; i < messages; ++i) {
      // At most so many bits as each may have.
      const int bits = std::min<int>(most, kMostWindowPieces);
      header.messages.push_back(
          {MessageId{message}, static_cast<std::uint8_t>(*rc::gen::inRange<int>(1, 1 << bits))});
      message += *rc::gen::inRange<std::uint32_t>(1, kMostAhead + 1);
    }
    const std::size_t room =
        kMaxDatagramBytes - kPacketOverhead - window_header_bytes(header.messages.size());
    bytes.resize(*rc::gen::inRange<std::size_t>(kSourceHeaderBytes + 1, room + 1));
    const auto fill = any<std::uint8_t>();
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(fill + 7 * i);
  }
};

Bytes any_packet() {
  Bytes out(kRoom);
  const auto type = static_cast<PacketType>(*rc::gen::inRange<int>(1, 16));
  const PacketHeader header = any_header(type);
  std::size_t size = 0;
  if (type == PacketType::kData) {
    const Piece piece;
    size = write_data(out, header, piece.fragment, piece.bytes);
  } else if (type == PacketType::kFeedback) {
    size = write_feedback(out, header, any_feedback());
  } else if (type == PacketType::kWindow) {
    const Symbol symbol;
    size = write_window(out, header, symbol.header, symbol.bytes);
  } else if (type == PacketType::kEcho) {
    size = write_echo(out, header, any_echo(),
                      *rc::gen::inRange<std::size_t>(0, kMaxDatagramBytes + 1));
  } else {
    size = write_probe(out, header, *rc::gen::inRange<std::size_t>(0, kMaxDatagramBytes + 1));
  }
  out.resize(size);
  return out;
}

RC_GTEST_PROP(PacketProperty, DataComesBack, ()) {
  const PacketHeader header = any_header(PacketType::kData);
  const Piece piece;
  Bytes out(kRoom);
  out.resize(write_data(out, header, piece.fragment, piece.bytes));
  RC_ASSERT(out.size() == kPieceOverheadBytes + piece.bytes.size());
  const auto packet = parse(out);
  RC_ASSERT(packet.has_value());
  RC_ASSERT(packet->header == header);
  RC_ASSERT(packet->data.fragment == piece.fragment);
  RC_ASSERT(std::ranges::equal(packet->data.bytes, piece.bytes));
}

RC_GTEST_PROP(PacketProperty, FeedbackComesBack, ()) {
  const PacketHeader header = any_header(PacketType::kFeedback);
  const Feedback feedback = any_feedback();
  Bytes out(kRoom);
  out.resize(write_feedback(out, header, feedback));
  const auto packet = parse(out);
  RC_ASSERT(packet.has_value());
  RC_ASSERT(packet->header == header);
  RC_ASSERT(packet->feedback == feedback);
}

RC_GTEST_PROP(PacketProperty, AWindowComesBack, ()) {
  const PacketHeader header = any_header(PacketType::kWindow);
  const Symbol symbol;
  Bytes out(kRoom);
  out.resize(write_window(out, header, symbol.header, symbol.bytes));
  RC_ASSERT(out.size() == kPacketOverhead + window_header_bytes(symbol.header.messages.size()) +
                              symbol.bytes.size());
  const auto packet = parse(out);
  RC_ASSERT(packet.has_value());
  RC_ASSERT(packet->header == header);
  RC_ASSERT(packet->window.header == symbol.header);
  RC_ASSERT(std::ranges::equal(packet->window.bytes, symbol.bytes));
}

RC_GTEST_PROP(PacketProperty, AProbeComesBack, ()) {
  const PacketHeader header = any_header(PacketType::kProbe);
  const auto size = *rc::gen::inRange<std::size_t>(0, kMaxDatagramBytes + 1);
  Bytes out(kRoom);
  out.resize(write_probe(out, header, size));
  RC_ASSERT(out.size() == std::max(size, kPacketOverhead));
  const auto packet = parse(out);
  RC_ASSERT(packet.has_value());
  RC_ASSERT(packet->header == header);
}

RC_GTEST_PROP(PacketProperty, AnEchoComesBack, ()) {
  const PacketHeader header = any_header(PacketType::kEcho);
  const Echo echo = any_echo();
  const auto size = *rc::gen::inRange<std::size_t>(0, kMaxDatagramBytes + 1);
  Bytes out(kRoom);
  out.resize(write_echo(out, header, echo, size));
  RC_ASSERT(out.size() == std::max(size, kEchoBytes));
  const auto packet = parse(out);
  RC_ASSERT(packet.has_value());
  RC_ASSERT(packet->header == header);
  RC_ASSERT(is_consistent(echo, out));
  RC_ASSERT(packet->echo.request == echo.request);
  RC_ASSERT(packet->echo.reply == echo.reply);
}

RC_GTEST_PROP(PacketProperty, ARoundHeaderComesBack, ()) {
  const RoundHeader header = any_round_header();
  std::array<std::byte, kRoundHeaderBytes> out{};
  write_round_header(out, header);
  const auto parsed = parse_round_header(out);
  RC_ASSERT(parsed.has_value());
  RC_ASSERT(*parsed == header);
}

PlainHeader any_plain_header() {
  PlainHeader header{.id = any<std::uint32_t>(),
                     .deadline_us = any_but_zero<std::uint32_t>(),
                     .t0 = PeerTime{Duration{any<std::int64_t>()}},
                     .channel = any<std::uint16_t>(),
                     .importance = any<std::uint8_t>(),
                     .variant = *rc::gen::inRange<std::uint8_t>(0, kMaxVariants),
                     .newest_only = any<bool>()};
  header.awaits_better = header.variant > 0 && any<bool>();
  if (any<bool>()) {
    header.needs = PlainHeader::Needs{};
    for (std::uint8_t& weight : header.needs->weights) weight = any<std::uint8_t>();
    header.needs->min_security = any<std::uint8_t>();
  }
  if (any<bool>()) header.order = {any<std::uint16_t>(), any<std::uint32_t>()};
  return header;
}

RC_GTEST_PROP(PacketProperty, APlainHeaderComesBack, ()) {
  const PlainHeader header = any_plain_header();
  std::array<std::byte, kMostPlainHeaderBytes> out{};
  write_plain_header(out, header);
  const auto parsed = parse_plain_header(out);
  RC_ASSERT(parsed.has_value());
  RC_ASSERT(*parsed == header);
  RC_ASSERT(header_bytes(MessageKind::kPlain, out) == header.bytes());
  RC_ASSERT(!parse_plain_header(std::span(out).first(header.bytes() - 1)));
}

RC_GTEST_PROP(PacketProperty, EveryChangeOfOneByteOfAPlainHeaderIsRefusedOrValid, ()) {
  std::array<std::byte, kMostPlainHeaderBytes> bytes{};
  write_plain_header(bytes, any_plain_header());
  const std::byte change{any_but_zero<std::uint8_t>()};
  for (std::byte& b : bytes) {
    b ^= change;
    RC_ASSERT(refused_or_consistent_plain(bytes));
    b ^= change;
  }
}

RC_GTEST_PROP(PacketProperty, OtherVersionsAreNeverOurs, (std::vector<std::uint8_t> bytes)) {
  const auto datagram = std::as_bytes(std::span(bytes));
  RC_ASSERT(!parse(datagram) || !other_version(datagram));
  const Bytes ours = any_packet();
  RC_ASSERT(!other_version(ours));
}

RC_GTEST_PROP(PacketProperty, EveryTruncationIsRefusedOrValid, ()) {
  const Bytes bytes = any_packet();
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    RC_ASSERT(refused_or_consistent(ByteView(bytes).first(n)));
  }
}

RC_GTEST_PROP(PacketProperty, EveryChangeOfOneByteIsRefusedOrValid, ()) {
  Bytes bytes = any_packet();
  const std::byte change{any_but_zero<std::uint8_t>()};
  for (std::byte& b : bytes) {
    b ^= change;
    RC_ASSERT(refused_or_consistent(bytes));
    b ^= change;
  }
}

RC_GTEST_PROP(PacketProperty, EveryChangeOfOneByteOfARoundHeaderIsRefusedOrValid, ()) {
  std::array<std::byte, kRoundHeaderBytes> bytes{};
  write_round_header(bytes, any_round_header());
  const std::byte change{any_but_zero<std::uint8_t>()};
  for (std::byte& b : bytes) {
    b ^= change;
    RC_ASSERT(refused_or_consistent_message(bytes));
    b ^= change;
  }
}

RC_GTEST_PROP(PacketProperty, AnyBytesAreRefusedOrValid, (std::vector<std::uint8_t> bytes)) {
  RC_ASSERT(refused_or_consistent(std::as_bytes(std::span(bytes))));
  RC_ASSERT(refused_or_consistent_message(std::as_bytes(std::span(bytes))));
  RC_ASSERT(refused_or_consistent_plain(std::as_bytes(std::span(bytes))));
}

}  // namespace
}  // namespace interneuron::wire::packet_property_test
