#include "core/wire/packet.h"

#include <algorithm>
#include <cassert>

#include "core/wire/bytes.h"

namespace interneuron::wire {
namespace {

// Flags of a link report.
constexpr std::uint8_t kHasExchange = 0x01;
constexpr std::uint8_t kMetered = 0x02;
// Flags of an echo.
constexpr std::uint8_t kIsReply = 0x01;
constexpr std::uint8_t kHold = 0x02;
constexpr std::int64_t kBitsPerKilobit = 1000;

void put_header(Writer& w, const PacketHeader& h) {
  w.put(static_cast<std::uint8_t>(h.type));
  w.put(h.link.value);
  w.put(h.epoch);
  w.put(std::uint8_t{0});
  w.put(h.session.value);
  w.put(h.number);
}

std::optional<PacketHeader> get_header(Reader& r) {
  PacketHeader h;
  const auto type = r.get<std::uint8_t>();
  h.link = LinkId{r.get<std::uint8_t>()};
  h.epoch = r.get<std::uint8_t>();
  const auto reserved = r.get<std::uint8_t>();
  h.session = SessionId{r.get<std::uint32_t>()};
  h.number = r.get<std::uint64_t>();
  if (!r.ok() || reserved != 0 || h.epoch != kClearEpoch || h.session.value == 0 || h.number == 0) {
    return std::nullopt;
  }
  if (type < static_cast<std::uint8_t>(PacketType::kData) ||
      type > static_cast<std::uint8_t>(PacketType::kEcho)) {
    return std::nullopt;
  }
  h.type = static_cast<PacketType>(type);
  return h;
}

std::optional<Data> get_data(Reader& r) {
  Data d;
  d.fragment.message = MessageId{r.get<std::uint32_t>()};
  d.fragment.index = r.get<std::uint16_t>();
  d.fragment.count = r.get<std::uint16_t>();
  d.fragment.chunk = r.get<std::uint16_t>();
  const auto reserved = r.get<std::uint16_t>();
  d.fragment.lifetime_us = r.get<std::uint32_t>();
  d.bytes = r.rest();
  const FragmentHeader& f = d.fragment;
  const bool last = f.index + 1 == f.count;
  const bool size_ok =
      last ? !d.bytes.empty() && d.bytes.size() <= f.chunk : d.bytes.size() == f.chunk;
  if (!r.ok() || reserved != 0 || f.chunk == 0 || f.index >= f.count || !size_ok) {
    return std::nullopt;
  }
  return d;
}

void put_rate(Writer& w, DataRate rate) {
  w.put(static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(rate.bits_per_second / kBitsPerKilobit, 0, UINT32_MAX)));
}

DataRate get_rate(Reader& r) {
  return {static_cast<std::int64_t>(r.get<std::uint32_t>()) * kBitsPerKilobit};
}

void put_report(Writer& w, const LinkReport& report) {
  w.put(report.link.value);
  w.put(static_cast<std::uint8_t>((report.has_exchange ? kHasExchange : 0) |
                                  (report.metered ? kMetered : 0)));
  w.put(report.loss);
  w.put(report.train_packets);
  w.put(report.s.time_since_epoch().count());
  w.put(report.h.count());
  w.put(report.largest);
  for (const std::uint64_t word : report.bitmap) w.put(word);
  w.put(report.train_start);
  put_rate(w, report.train_rate);
  put_rate(w, report.rate);
}

bool get_report(Reader& r, LinkReport& report) {
  report.link = LinkId{r.get<std::uint8_t>()};
  const auto flags = r.get<std::uint8_t>();
  report.loss = r.get<std::uint16_t>();
  report.train_packets = r.get<std::uint32_t>();
  report.s = PeerTime{Duration{r.get<std::int64_t>()}};
  report.h = Duration{r.get<std::int64_t>()};
  report.largest = r.get<std::uint64_t>();
  for (std::uint64_t& word : report.bitmap) word = r.get<std::uint64_t>();
  report.train_start = r.get<std::uint64_t>();
  report.train_rate = get_rate(r);
  report.rate = get_rate(r);
  report.has_exchange = (flags & kHasExchange) != 0;
  report.metered = (flags & kMetered) != 0;
  return r.ok() && (flags & ~(kHasExchange | kMetered)) == 0 && report.h.count() >= 0;
}

bool get_feedback(Reader& r, Feedback& f) {
  f.u = r.get<std::int64_t>();
  f.echo = SessionId{r.get<std::uint32_t>()};
  const auto count = r.get<std::uint32_t>();
  if (!r.ok() || count > kMaxReports) return false;
  for (std::uint32_t i = 0; i < count; ++i) {
    LinkReport report;
    if (!get_report(r, report)) return false;
    f.reports.push_back(report);
  }
  return r.at_end();
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
  return e;
}

std::size_t finish(Writer& w) {
  w.put_zeros(kTagBytes);
  assert(w.ok());
  return w.size();
}

}  // namespace

std::optional<Packet> parse(ByteView datagram) {
  if (datagram.size() < kPacketOverhead) return std::nullopt;
  const ByteView tag = datagram.last(kTagBytes);
  if (!std::ranges::all_of(tag, [](std::byte b) { return b == std::byte{0}; })) return std::nullopt;

  Reader r(datagram.first(datagram.size() - kTagBytes));
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
    case PacketType::kProbe:
      return parsed;
    case PacketType::kEcho: {
      const auto echo = get_echo(r);
      if (!echo) return std::nullopt;
      packet.echo = *echo;
      return parsed;
    }
  }
  return std::nullopt;
}

std::size_t write_data(std::span<std::byte> out, const PacketHeader& header,
                       const FragmentHeader& fragment, ByteView bytes) {
  Writer w(out);
  put_header(w, header);
  w.put(fragment.message.value);
  w.put(fragment.index);
  w.put(fragment.count);
  w.put(fragment.chunk);
  w.put(std::uint16_t{0});
  w.put(fragment.lifetime_us);
  w.put_bytes(bytes);
  return finish(w);
}

std::size_t write_feedback(std::span<std::byte> out, const PacketHeader& header,
                           const Feedback& feedback) {
  Writer w(out);
  put_header(w, header);
  w.put(feedback.u);
  w.put(feedback.echo.value);
  assert(feedback.reports.size() <= kMaxReports);
  w.put(static_cast<std::uint32_t>(feedback.reports.size()));
  for (const LinkReport& report : feedback.reports) put_report(w, report);
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
  w.put_zeros(std::max(size, kEchoBytes) - kEchoBytes);
  return finish(w);
}

}  // namespace interneuron::wire
