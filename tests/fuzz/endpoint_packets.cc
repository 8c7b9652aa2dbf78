#include "tests/fuzz/endpoint_packets.h"

#include <algorithm>

#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"
#include "interneuron/sizes.h"

namespace interneuron::fuzz {
namespace {

constexpr std::size_t kRoom = 2048;

wire::PacketHeader any_header(Input& input, const Sender& sender, wire::PacketType type) {
  wire::PacketHeader out{.type = type, .link = sender.link};
  const std::uint32_t sessions[] = {sender.session.value, sender.session.value,
                                    sender.session.value, sender.session.value + 1};
  out.session = SessionId{std::max(1U, input.one_of(sessions))};
  const std::uint64_t numbers[] = {sender.next_number,       sender.next_number,
                                   sender.next_number,       sender.next_number + 3,
                                   sender.next_number + 300, UINT64_MAX};
  out.number = std::max<std::uint64_t>(1, input.one_of(numbers));
  out.stamp_us = input.flip() ? wire::send_stamp(sender.now) : input.take<std::uint32_t>();
  return out;
}

std::int64_t any_time(Input& input, TimePoint now) {
  const std::int64_t n = now.time_since_epoch().count();
  const std::int64_t times[] = {n, 0, n - 50'000'000, n + 50'000'000, INT64_MAX, INT64_MIN, -1};
  return input.one_of(times);
}

std::uint32_t any_duration_us(Input& input) {
  const std::uint32_t times[] = {130'000, 1, 10'000'000, UINT32_MAX};
  return std::max(1U, input.one_of(times));
}

Bytes any_plain_message(Input& input, const Sender& sender) {
  wire::PlainHeader h;
  h.id = input.take<std::uint8_t>();
  h.deadline_us = any_duration_us(input);
  h.t0 = PeerTime{Duration{any_time(input, sender.now)}};
  h.channel = static_cast<std::uint16_t>(input.below(4));
  h.importance = input.take<std::uint8_t>();
  h.variant = static_cast<std::uint8_t>(input.below(kMaxVariants));
  h.newest_only = input.flip();
  h.awaits_better = h.variant > 0 && input.flip();
  if (input.flip()) h.needs = wire::PlainHeader::Needs{};
  if (input.flip()) h.order = {input.take<std::uint8_t>(), any_duration_us(input)};
  Bytes out(h.bytes() + input.below(64));
  wire::write_plain_header(out, h);
  return out;
}

Bytes any_round_message(Input& input, const Sender& sender) {
  wire::RoundHeader h;
  h.stages = static_cast<std::uint8_t>(1 + input.below(kMaxStages));
  h.stage = static_cast<std::uint8_t>(1 + input.below(h.stages));
  h.communication = static_cast<std::uint16_t>(input.take<std::uint16_t>() | (1U << (h.stage - 1)));
  const std::uint32_t origins[] = {sender.session.value, sender.endpoint.value};
  const std::uint32_t rounds[] = {0, 1, 2, 3, 64, UINT32_MAX};
  h.round = {SessionId{std::max(1U, input.one_of(origins))},
             PipelineId{static_cast<std::uint8_t>(input.below(3))}, RoundId{input.one_of(rounds)}};
  h.variant = static_cast<std::uint8_t>(input.below(kMaxVariants));
  h.best_planned = static_cast<std::uint8_t>(input.below(h.variant + 1U));
  h.degraded = input.flip();
  h.message_class = input.flip() ? MessageClass::kResult : MessageClass::kData;
  const std::uint32_t policies[] = {wire::policy_id("down_sampling"),
                                    wire::policy_id("progressive")};
  h.policy = input.one_of(policies);
  h.t0 = PeerTime{Duration{any_time(input, sender.now)}};
  h.alpha_sum = Duration{input.flip() ? 0 : any_time(input, sender.now)};
  const std::int16_t xs[] = {0, -1000, INT16_MAX};
  h.x_permille = std::max<std::int16_t>(-1000, input.one_of(xs));
  h.deadline_us = any_duration_us(input);
  h.period_us = any_duration_us(input);
  for (RoundState& s : h.indicator) s = static_cast<RoundState>(input.below(3));
  h.guard = input.flip() ? GuardKind::kBudget : GuardKind::kPaper;
  h.level_used = input.take<std::uint8_t>();
  h.variant_used = input.flip() ? wire::kNoneUsed : static_cast<std::uint8_t>(input.below(8));
  h.local_quality = input.take<std::uint8_t>();
  h.miss_price = input.take<std::uint16_t>();
  h.excess = input.take<std::int16_t>();
  h.computed = input.take<std::uint16_t>();
  h.e2e[0] = input.take<std::uint16_t>();
  h.e2e[1] = input.take<std::uint16_t>();
  Bytes out(wire::kRoundHeaderBytes + input.below(64));
  wire::write_round_header(std::span(out).first<wire::kRoundHeaderBytes>(), h);
  return out;
}

wire::FragmentHeader any_fragment(Input& input, std::size_t size, wire::MessageKind kind) {
  wire::FragmentHeader out;
  out.message = MessageId{input.take<std::uint8_t>()};
  out.chunk = static_cast<std::uint16_t>(size);
  out.size = static_cast<std::uint32_t>(size);
  out.lifetime_us = any_duration_us(input);
  out.kind = kind;
  return out;
}

// A piece or a repair symbol of a message of any size, up to those that no memory could hold.
std::size_t any_piece(Input& input, const Sender& sender, std::span<std::byte> out) {
  const std::uint16_t chunks[] = {1, 40, 1000, static_cast<std::uint16_t>(kMaxPieceBytes)};
  const std::uint32_t sizes[] = {100, 3000, 300'000, kMaxMessageBytes, kMaxMessageBytes + 200};
  wire::FragmentHeader f =
      any_fragment(input, 1, input.flip() ? wire::MessageKind::kPlain : wire::MessageKind::kRound);
  f.chunk = static_cast<std::uint16_t>(1 + (input.one_of(chunks) - 1U) % kMaxPieceBytes);
  f.size = static_cast<std::uint32_t>(1 + (input.one_of(sizes) - 1U) %
                                              (std::uint64_t{UINT16_MAX} * f.chunk));
  f.index = input.take<std::uint16_t>();
  if (input.flip()) f.index = static_cast<std::uint16_t>(f.index % f.count());
  const auto fill = input.take<std::byte>();
  return wire::write_data(out, any_header(input, sender, wire::PacketType::kData), f,
                          Bytes(f.bytes(), fill));
}

wire::LinkReport any_report(Input& input, const Sender& sender) {
  wire::LinkReport r;
  r.link = LinkId{static_cast<std::uint16_t>(input.below(4))};
  r.has_exchange = input.flip();
  r.s = PeerTime{Duration{any_time(input, sender.now)}};
  r.h = Duration{any_time(input, sender.now) & INT64_MAX};
  const std::uint64_t numbers[] = {sender.heard_number, sender.heard_number,
                                   sender.heard_number + 1, UINT64_MAX};
  r.largest = input.one_of(numbers);
  r.bitmap[0] = input.flip() ? UINT64_MAX : input.take<std::uint64_t>();
  r.bitmap[1] = input.flip() ? UINT64_MAX : 0;
  r.train_start = input.one_of(numbers);
  r.train_packets = input.take<std::uint8_t>();
  const std::uint32_t kbits[] = {0, 1, 30'000, UINT32_MAX};
  r.train_rate = DataRate{std::int64_t{input.one_of(kbits)} * 1000};
  r.rate = DataRate{std::int64_t{input.one_of(kbits)} * 1000};
  r.loss = input.take<std::uint16_t>();
  r.metered = input.flip();
  r.has_delays = input.flip();
  r.newest_delay_us = input.take<std::uint32_t>();
  r.largest_delay_us = r.newest_delay_us + input.take<std::uint16_t>();
  r.ect1_packets = input.take<std::uint32_t>();
  r.ect0_packets = static_cast<std::uint16_t>(r.ect1_packets >> 16U);
  r.ce_packets = input.take<std::uint32_t>();
  r.received_bytes = input.take<std::uint32_t>();
  return r;
}

wire::Feedback any_feedback(Input& input, const Sender& sender) {
  wire::Feedback f;
  f.u = any_time(input, sender.now);
  const std::uint32_t echoes[] = {sender.endpoint.value, sender.endpoint.value, 0};
  f.echo = SessionId{input.one_of(echoes)};
  f.features = input.flip() ? wire::kDecodesWindows : input.take<std::uint16_t>();
  for (std::size_t n = input.below(4); n > 0; --n) f.reports.push_back(any_report(input, sender));
  for (std::size_t n = input.below(4); n > 0; --n) {
    f.complete.push_back({MessageId{input.take<std::uint8_t>()},
                          input.take<std::uint32_t>() & wire::kLongestAgo, input.flip()});
  }
  for (std::size_t n = input.below(3); n > 0; --n) {
    f.refused.push_back(MessageId{input.take<std::uint8_t>()});
  }
  return f;
}

wire::Echo any_echo(Input& input) {
  wire::Echo e;
  e.is_reply = input.below(4) == 0;
  const std::uint16_t trains[] = {0, 0, 1, 2};
  e.train = input.one_of(trains);
  if (e.train == 0) {
    const std::uint8_t delays[] = {0, 1, 255};
    e.delay = input.one_of(delays);
  } else {
    e.count = static_cast<std::uint16_t>(2 + input.below(wire::kMaxEchoTrain - 1));
    e.index = static_cast<std::uint16_t>(input.take<std::uint8_t>() % e.count);
    e.hold = input.flip();
  }
  if (e.is_reply) {
    e.reply.sequence = input.take<std::uint32_t>();
  } else {
    e.request.sequence = input.take<std::uint32_t>();
  }
  return e;
}

std::size_t any_window(Input& input, const Sender& sender, std::span<std::byte> out) {
  wire::WindowHeader h;
  h.row = static_cast<std::uint8_t>(input.below(code::kMostRows));
  MessageId message{input.take<std::uint8_t>()};
  for (std::size_t n = 1 + input.below(4); n > 0; --n) {
    const auto pieces = static_cast<std::uint8_t>(1U << input.below(8));
    h.messages.push_back({message, pieces});
    message.value += 1U + static_cast<std::uint32_t>(input.below(3));
  }
  const std::size_t size = wire::kSourceHeaderBytes + 1 + input.below(200);
  Bytes symbol(size, input.take<std::byte>());
  std::ranges::copy(input.bytes(wire::kSourceHeaderBytes), symbol.begin());
  return wire::write_window(out, any_header(input, sender, wire::PacketType::kWindow), h, symbol);
}

// A packet of a type whose body this version does not write: a probe with its type changed.
std::size_t any_unused(Input& input, const Sender& sender, std::span<std::byte> out) {
  const std::uint8_t types[] = {5, 7, 8, 9, 15};
  const std::size_t size =
      wire::write_probe(out, any_header(input, sender, wire::PacketType::kProbe),
                        wire::kPacketOverhead + input.below(80));
  const auto type = static_cast<std::byte>(types[input.below(std::size(types))]);
  out[0] = (out[0] & std::byte{0xf0}) | type;
  const ByteView body = input.bytes(std::min<std::size_t>(size - wire::kPacketOverhead, 24));
  std::ranges::copy(body, out.begin() + wire::kHeaderBytes);
  return size;
}

std::size_t any_message(Input& input, const Sender& sender, wire::MessageKind kind,
                        std::span<std::byte> out) {
  const Bytes message = kind == wire::MessageKind::kPlain ? any_plain_message(input, sender)
                                                          : any_round_message(input, sender);
  return wire::write_data(out, any_header(input, sender, wire::PacketType::kData),
                          any_fragment(input, message.size(), kind), message);
}

}  // namespace

Bytes any_packet(Input& input, const Sender& sender, Kind kind) {
  Bytes out(kRoom);
  std::size_t size = 0;
  switch (kind) {
    case Kind::kPlainMessage:
      size = any_message(input, sender, wire::MessageKind::kPlain, out);
      break;
    case Kind::kRoundMessage:
      size = any_message(input, sender, wire::MessageKind::kRound, out);
      break;
    case Kind::kPiece:
      size = any_piece(input, sender, out);
      break;
    case Kind::kFeedback:
      size = wire::write_feedback(out, any_header(input, sender, wire::PacketType::kFeedback),
                                  any_feedback(input, sender));
      break;
    case Kind::kProbe:
      size = wire::write_probe(out, any_header(input, sender, wire::PacketType::kProbe),
                               wire::kPacketOverhead + input.below(2) * 1'000 + input.below(200));
      break;
    case Kind::kEcho:
      size = wire::write_echo(out, any_header(input, sender, wire::PacketType::kEcho),
                              any_echo(input), wire::kEchoBytes + input.below(100));
      break;
    case Kind::kWindow:
      size = any_window(input, sender, out);
      break;
    case Kind::kUnused:
      size = any_unused(input, sender, out);
      break;
  }
  out.resize(size);
  return out;
}

Bytes answer_packet(Input& input, const Sender& sender, ByteView token, bool with_session) {
  const std::size_t before = with_session ? 4 : 0;
  Bytes out(kRoom);
  const std::size_t size =
      wire::write_probe(out, any_header(input, sender, wire::PacketType::kProbe),
                        wire::kPacketOverhead + before + token.size());
  out.resize(size);
  out[0] = (out[0] & std::byte{0xf0}) | std::byte{8};
  for (std::size_t i = 0; i < before; ++i) {
    out[wire::kHeaderBytes + i] = static_cast<std::byte>(sender.session.value >> (24 - 8 * i));
  }
  std::ranges::copy(token, out.begin() + static_cast<std::ptrdiff_t>(wire::kHeaderBytes + before));
  return out;
}

}  // namespace interneuron::fuzz
