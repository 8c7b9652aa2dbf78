// A roadside unit whose datagrams are made by hand, and how somebody joins it: for tests of who
// becomes a peer.
#pragma once

#include "core/wire/packet.h"
#include "interneuron/endpoint.h"
#include "pair.h"

namespace interneuron::join_test {

inline constexpr SessionId kRoad{1000};

// 10.net.subnet.host:port as a sockaddr_in has it.
inline Address ipv4(std::uint8_t net, std::uint8_t subnet, std::uint8_t host,
                    std::uint16_t port = 1) {
  Address a;
  a.size = 16;
  a.raw[0] = std::byte{2};
  a.raw[2] = static_cast<std::byte>(port >> 8U);
  a.raw[3] = static_cast<std::byte>(port);
  a.raw[4] = std::byte{10};
  a.raw[5] = std::byte{net};
  a.raw[6] = std::byte{subnet};
  a.raw[7] = std::byte{host};
  return a;
}

struct Sent {
  LinkId link{};
  Address to{};
  Bytes bytes;
};

// A roadside unit whose datagrams are made by hand.
struct Unit {
  Endpoint endpoint;
  TimePoint now{1h};
  std::vector<PeerId> ready;
  std::vector<PeerId> lost;
  int delivered = 0;

  explicit Unit(std::size_t max_peers = 8, bool accept = true) : endpoint(make(max_peers, accept)) {
    for (const LinkId link : {kFast, kSlow}) endpoint.add_link(now, link, {"nic", 1500});
  }
  static Endpoint make(std::size_t max_peers, bool accept) {
    EndpointOptions o = options_of(kRoad.value, {pipeline_of({kComm, kComm})}, accept);
    o.max_peers = max_peers;
    o.secret = {0x0123456789abcdef, 0xfedcba9876543210};
    return Endpoint(std::move(o), TimePoint{1h});
  }
  std::vector<Sent> feed(const Address& from, ByteView bytes, LinkId link = kFast) {
    endpoint.handle_datagram(now, {link, from, bytes});
    return drain();
  }
  std::vector<Sent> drain() {
    std::vector<Sent> out;
    std::array<std::byte, kMaxDatagramBytes> buffer;
    while (const auto event = endpoint.poll_event()) {
      if (const auto* e = std::get_if<PeerReady>(&*event)) ready.push_back(e->peer);
      if (const auto* e = std::get_if<PeerLost>(&*event)) lost.push_back(e->peer);
      delivered += std::holds_alternative<Delivered>(*event) ? 1 : 0;
    }
    while (const auto t = endpoint.poll_transmit(now, buffer)) {
      out.push_back({t->link, t->to,
                     Bytes(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(t->size))});
    }
    return out;
  }
  std::vector<Sent> sleep(Duration by) {
    std::vector<Sent> out;
    for (const TimePoint end = now + by;;) {
      const auto next = endpoint.next_timeout();
      now = std::min(end, std::max(now, next.value_or(end)));
      endpoint.handle_timeout(now);
      for (Sent& s : drain()) out.push_back(std::move(s));
      if (now == end) return out;
    }
  }
  std::size_t peers() const { return endpoint.peers().size(); }
};

inline wire::PacketHeader header_of(wire::PacketType type, SessionId session, std::uint64_t number,
                                    LinkId path = LinkId{0}) {
  return {type, path, wire::kClearEpoch, session, number};
}

inline Bytes hello(SessionId session, std::uint64_t number = 1, SessionId echo = {},
                   LinkId path = LinkId{0}) {
  Bytes out(kMaxDatagramBytes);
  wire::Feedback feedback;
  feedback.u = static_cast<std::int64_t>(number);
  feedback.echo = echo;
  out.resize(wire::write_feedback(
      out, header_of(wire::PacketType::kFeedback, session, number, path), feedback));
  return out;
}

inline Bytes token_packet(SessionId session, std::uint64_t number, const wire::Token& token,
                          LinkId path = LinkId{0}) {
  Bytes out(kMaxDatagramBytes);
  out.resize(
      wire::write_token(out, header_of(wire::PacketType::kToken, session, number, path), token));
  return out;
}

// The challenge among what was sent to this address.
inline std::optional<wire::Packet> challenge_in(const std::vector<Sent>& sent, const Address& to) {
  for (const Sent& s : sent) {
    const auto packet = wire::parse(s.bytes);
    if (s.to == to && packet && packet->header.type == wire::PacketType::kChallenge) return packet;
  }
  return std::nullopt;
}

// Asks, and answers the challenge. `ready`: it also shows that it has heard the unit.
inline void join(Unit& unit, SessionId session, const Address& from, bool ready = true) {
  const auto challenge = challenge_in(unit.feed(from, hello(session)), from);
  ASSERT_TRUE(challenge);
  unit.feed(from, token_packet(session, 2, challenge->challenge.token));
  if (ready) unit.feed(from, hello(session, 3, kRoad));
}

}  // namespace interneuron::join_test
