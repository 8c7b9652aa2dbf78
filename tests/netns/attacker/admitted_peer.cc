#include "tests/netns/attacker/admitted_peer.h"

#include <sys/socket.h>

#include <algorithm>
#include <array>

#include "core/wire/bytes.h"

namespace interneuron::attacker {
namespace {

using namespace std::chrono_literals;

// How often feedback leaves: as often as the packets of a peer that sends are acknowledged.
constexpr Duration kSayEvery = 50ms;
// What may leave at once after a pause; no measurement behind it: three full packets, so that even
// an attack of 2 s keeps to its rate.
constexpr double kBurstBytes = 4'000;
// Types of packets that admission has (docs/wire_format.md), and the size of a token.
constexpr std::uint8_t kChallenge = 7;
constexpr std::uint8_t kToken = 8;
constexpr std::size_t kTokenBytes = 16;
constexpr std::size_t kChallengeBytes = wire::kPacketOverhead + 4 + kTokenBytes;
// Where a header has its packet's number.
constexpr std::size_t kNumberOffset = 8;

std::uint8_t type_of(ByteView packet) {
  const auto first = std::to_integer<std::uint8_t>(packet[0]);
  return first >> 4 == wire::kVersion ? first & 0x0F : 0;
}

}  // namespace

std::uint32_t sender_of(ByteView packet) {
  if (packet.size() < wire::kPacketOverhead) return 0;
  wire::Reader in(packet.subspan(4));
  return in.get<std::uint32_t>();
}

std::uint32_t challenged(ByteView packet) {
  if (packet.size() < kChallengeBytes || type_of(packet) != kChallenge) return 0;
  wire::Reader in(packet.subspan(wire::kHeaderBytes));
  return in.get<std::uint32_t>();
}

std::size_t answer_challenge(ByteView challenge, SessionId self, std::uint64_t number,
                             std::span<std::byte> out) {
  if (self.value == 0 || challenged(challenge) != self.value) return 0;
  wire::Reader in(challenge.subspan(2));
  const auto link = in.get<std::uint16_t>();
  wire::Writer w(out);
  w.put(static_cast<std::uint8_t>(wire::kVersion << 4 | kToken));
  w.put(wire::kClearEpoch);
  w.put(link);
  w.put(self.value);
  w.put(number);
  w.put(std::uint32_t{0});
  w.put_bytes(challenge.subspan(wire::kHeaderBytes + 4, kTokenBytes));
  w.put_zeros(wire::kTagBytes);
  return w.size();
}

Bytes hello(const wire::PacketHeader& header, std::int64_t u, std::uint32_t echo) {
  wire::Feedback feedback;
  feedback.u = u;
  feedback.echo = {echo};
  Bytes out(wire::feedback_bytes(0));
  wire::write_feedback(out, header, feedback);
  return out;
}

AdmittedPeer::AdmittedPeer(int socket, double bits_per_second, TimePoint now,
                           std::mt19937_64& random, const Keys* keys)
    : socket_(socket),
      bytes_per_second_(bits_per_second / 8),
      began_(now),
      refilled_(now),
      say_at_(now),
      session_{static_cast<std::uint32_t>(random()) | 1},
      number_(random() & 0xFFFF) {
  if (keys != nullptr) channel_ = std::make_shared<SealedChannel>(*keys, session_, random);
}

wire::PacketHeader AdmittedPeer::header(wire::PacketType type, TimePoint now) const {
  return {.type = type,
          .link = {0},
          .session = session_,
          .number = 1,
          .stamp_us = wire::send_stamp(TimePoint{now - began_})};
}

void AdmittedPeer::turn(TimePoint now) {
  receive(now);
  allowance_ += bytes_per_second_ * to_seconds(now - refilled_);
  allowance_ = std::min(allowance_, kBurstBytes);
  refilled_ = now;
  if (channel_) {
    const Bytes initiation = channel_->poll(now);
    if (!initiation.empty()) send_bytes(initiation);
    if (!channel_->is_open()) return;
  }
  if (now >= say_at_) say(now);
  flush(now);
}

void AdmittedPeer::receive(TimePoint now) {
  std::array<std::byte, kMaxDatagramBytes + 1> buffer;
  for (;;) {
    const ssize_t n = ::recv(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n < 0) return;
    ++counters_.received_packets;
    const ByteView packet = ByteView(buffer).first(static_cast<std::size_t>(n));
    channel_ ? take_sealed(now, packet) : take(now, packet);
  }
}

void AdmittedPeer::take_sealed(TimePoint now, ByteView packet) {
  const SealedChannel::Took took = channel_->take(now, packet);
  echo_ = channel_->life();
  if (took.token) show(*took.token);
  const auto opened = wire::parse_opened(took.opened);
  if (!opened) return;
  if (opened->header.type == wire::PacketType::kChallenge) {
    ++counters_.challenges;
    show(opened->challenge.token);
    return;
  }
  take_opened(now, *opened);
}

void AdmittedPeer::show(const wire::Token& token) {
  token_.resize(wire::kPacketOverhead + wire::kTokenBytes);
  auto head = header(wire::PacketType::kToken, refilled_);
  head.number = next_number();
  wire::write_token(token_, head, token);
  send_now(token_);
}

void AdmittedPeer::take(TimePoint now, ByteView packet) {
  std::array<std::byte, kMaxDatagramBytes> out;
  if (challenged(packet) == session_.value) {
    ++counters_.challenges;
    const std::size_t size = answer_challenge(packet, session_, next_number(), out);
    token_.assign(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size));
    send_now(token_);
    return;
  }
  const auto parsed = wire::parse(packet);
  if (!parsed) return;
  echo_ = parsed->header.session.value;
  take_opened(now, *parsed);
}

void AdmittedPeer::take_opened(TimePoint now, const wire::Packet& packet) {
  note_number(packet.header.number);
  if (packet.header.type == wire::PacketType::kData) ++counters_.results;
  if (packet.header.type != wire::PacketType::kFeedback) return;
  newest_u_ = packet.feedback.u;
  newest_at_ = now;
  if (packet.feedback.echo == session_) joined_ = true;
}

void AdmittedPeer::note_number(std::uint64_t number) {
  if (number > largest_) {
    const std::uint64_t ahead = number - largest_;
    before_ = ahead < wire::kAckWindow ? before_ << ahead : std::bitset<wire::kAckWindow>{};
    if (largest_ > 0 && ahead <= wire::kAckWindow) before_.set(ahead - 1);
    largest_ = number;
  } else if (number < largest_ && largest_ - number <= wire::kAckWindow) {
    before_.set(largest_ - number - 1);
  }
}

void AdmittedPeer::say(TimePoint now) {
  say_at_ = now + kSayEvery;
  wire::Feedback feedback;
  feedback.u = now.time_since_epoch().count();
  feedback.echo = {echo_};
  if (largest_ > 0) {
    wire::LinkReport report{.has_exchange = newest_at_ != TimePoint{},
                            .s = PeerTime{Duration{newest_u_}},
                            .h = now - newest_at_,
                            .largest = largest_};
    for (std::size_t i = 0; i < wire::kAckWindow; ++i) {
      if (before_[i]) report.bitmap[i / 64] |= std::uint64_t{1} << (i % 64);
    }
    feedback.reports.push_back(report);
  }
  std::array<std::byte, kMaxDatagramBytes> out;
  auto head = header(wire::PacketType::kFeedback, now);
  head.number = next_number();
  send_now(ByteView(out).first(wire::write_feedback(out, head, feedback)));
}

void AdmittedPeer::send_message(ByteView message, std::uint32_t lifetime_us) {
  const auto size = static_cast<std::uint32_t>(message.size());
  const auto chunk = static_cast<std::uint16_t>(
      std::min<std::size_t>(size, kMaxDatagramBytes - kPieceOverheadBytes));
  const std::uint32_t id = message_;
  for (std::uint32_t at = 0; at < size; at += chunk) {
    message_ = id;
    send_piece(size, chunk, static_cast<std::uint16_t>(at / chunk),
               message.subspan(at, std::min<std::size_t>(chunk, size - at)), lifetime_us);
  }
}

void AdmittedPeer::send_piece(std::uint32_t size, std::uint16_t chunk, std::uint16_t index,
                              ByteView bytes, std::uint32_t lifetime_us) {
  const wire::FragmentHeader fragment{.message = {message_++},
                                      .index = index,
                                      .chunk = chunk,
                                      .size = size,
                                      .lifetime_us = lifetime_us,
                                      .kind = wire::MessageKind::kRound};
  Bytes out(kPieceOverheadBytes + bytes.size());
  wire::write_data(out, header(wire::PacketType::kData, refilled_), fragment, bytes);
  send_packet(std::move(out));
}

void AdmittedPeer::send_packet(Bytes packet, bool own_number) {
  queue_.push_back({std::move(packet), own_number});
}

void AdmittedPeer::flush(TimePoint now) {
  while (!queue_.empty() && allowance_ > 0) {
    Waiting next = std::move(queue_.front());
    queue_.pop_front();
    wire::Writer w(std::span(next.packet).subspan(kNumberOffset));
    if (!next.own_number) w.put(next_number());
    w = wire::Writer(std::span(next.packet).subspan(kNumberOffset + 8));
    w.put(wire::send_stamp(TimePoint{now - began_}));
    send_now(next.packet);
  }
}

void AdmittedPeer::send_now(ByteView packet) {
  if (!channel_) return send_bytes(packet);
  Bytes sealed(packet.begin(), packet.end());
  channel_->seal(sealed);
  send_bytes(sealed);
}

void AdmittedPeer::send_bytes(ByteView packet) {
  if (::send(socket_, packet.data(), packet.size(), MSG_DONTWAIT) < 0) return;
  ++counters_.sent_packets;
  counters_.sent_bytes += packet.size() + kIpUdpBytes;
  allowance_ -= static_cast<double>(packet.size() + kIpUdpBytes);
}

}  // namespace interneuron::attacker
