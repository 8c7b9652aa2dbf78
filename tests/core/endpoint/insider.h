// An admitted vehicle that attacks, beside an honest one, at a roadside unit that answers; all in
// virtual time.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"
#include "pipe.h"

namespace interneuron {

// What the attacker writes, packet by packet: any header, numbers as a sender counts them.
class Attacker {
 public:
  Attacker(Pipe& pipe, std::size_t road, std::size_t host, std::uint32_t session)
      : pipe_(pipe), road_(road), host_(host), session_(session) {}

  // A round of the attacker's own that asks for a computation and its result.
  wire::RoundHeader round(std::uint32_t which) const {
    return wire::RoundHeader{.round = {SessionId{session_}, PipelineId{0}, RoundId{which}},
                             .stage = 1,
                             .stages = 3,
                             .communication = 0b101,
                             .policy = wire::policy_id("down_sampling"),
                             .t0 = PeerTime{pipe_.local(road_).time_since_epoch()},
                             .deadline_us = 130'000};
  }
  // Sends the first of the pieces that a message is cut into; all of it where it fits one.
  void send(const wire::RoundHeader& header, std::size_t payload = 20) {
    Bytes message(wire::kRoundHeaderBytes + payload, std::byte{0x66});
    wire::write_round_header(std::span(message).first<wire::kRoundHeaderBytes>(), header);
    const auto size = static_cast<std::uint32_t>(message.size());
    piece({next_message(), 0, static_cast<std::uint16_t>(size), size, header.deadline_us}, message);
  }
  // A plain message on this channel.
  void send_plain(std::uint16_t channel, std::size_t payload) {
    wire::PlainHeader header;
    header.id = ++plain_;
    header.deadline_us = 100'000;
    header.channel = channel;
    header.t0 = PeerTime{pipe_.local(road_).time_since_epoch()};
    Bytes message(wire::kPlainHeaderBytes + payload, std::byte{0x66});
    wire::write_plain_header(std::span(message).first<wire::kPlainHeaderBytes>(), header);
    const auto size = static_cast<std::uint32_t>(message.size());
    piece({next_message(), 0, static_cast<std::uint16_t>(size), size, header.deadline_us,
           wire::MessageKind::kPlain},
          message);
  }
  void piece(const wire::FragmentHeader& fragment, ByteView bytes) {
    std::array<std::byte, 2 * kMaxDatagramBytes> out;
    feed(std::span(out).first(
        wire::write_data(out, header(wire::PacketType::kData), fragment, bytes)));
  }
  void probe(std::size_t size) {
    std::array<std::byte, kMaxDatagramBytes> out;
    feed(std::span(out).first(wire::write_probe(out, header(wire::PacketType::kProbe), size)));
  }
  // Asks, and answers the challenge.
  void join() {
    std::optional<wire::Token> token;
    pipe_.on_transmit = [this, &token](std::size_t, std::size_t to, LinkId, const Bytes& bytes) {
      const auto packet = wire::parse(bytes);
      if (to != host_ || !packet || packet->header.type != wire::PacketType::kChallenge) return;
      token = packet->challenge.token;
    };
    probe(100);
    pipe_.on_transmit = nullptr;
    ASSERT_TRUE(token);
    std::array<std::byte, kMaxDatagramBytes> out;
    feed(std::span(out).first(wire::write_token(out, header(wire::PacketType::kToken), *token)));
  }
  void feed(ByteView datagram) {
    pipe_.at(road_).handle_datagram(pipe_.local(road_), {kFast, address_of(host_), datagram});
    pipe_.flush(road_);
  }
  wire::PacketHeader header(wire::PacketType type) {
    return {type, kFast, wire::kClearEpoch, SessionId{session_}, ++number, 0};
  }
  MessageId next_message() { return MessageId{++message_}; }

  // The number of the newest packet.
  std::uint64_t number = 0;

 private:
  Pipe& pipe_;
  std::size_t road_;
  std::size_t host_;
  std::uint32_t session_;
  std::uint32_t message_ = 0;
  std::uint32_t plain_ = 0;
};

// The honest vehicle's rounds, and whether the road served each with what it was sent.
class Insider : public testing::Test {
 protected:
  static constexpr std::uint32_t kHonest = 1;
  static constexpr std::uint32_t kRoad = 2;
  static constexpr std::uint32_t kAttacker = 3;
  static constexpr std::byte kMark{0x11};

  explicit Insider(const EndpointOptions& road_options = options_of(kRoad)) {
    honest = pipe.add_host(options_of(kHonest, {pipeline_of({kComm, kComp, kComm})}, false));
    road = pipe.add_host(road_options);
    pipe.on_event = [this](std::size_t host, Event& event) { note(host, event); };
    pipe.connect(honest, road);
    pipe.run(1s);
    attacker.join();
    for (const PeerId id : pipe.at(road).peers()) {
      if (id != honest_at_road) attacker_at_road = id;
    }
  }

  // A round every 100 ms while the attacker does what it does before each of them.
  template <class Attack>
  void rounds(int count, const Attack& attack) {
    for (int i = 0; i < count; ++i) {
      attack(i);
      pipe.round(honest, PipelineId{0}, {Bytes(20'000, kMark), Bytes(5'000, kMark)});
      pipe.run(100ms);
    }
    pipe.run(1s);
    begun += count;
  }
  void expect_unharmed() const {
    EXPECT_EQ(remote, begun);
    EXPECT_EQ(late, 0);
    EXPECT_EQ(mixed, 0);
    for (const std::uint64_t strikes : pipe_ledger(honest_at_road).strikes) EXPECT_EQ(strikes, 0U);
  }
  PeerLedger pipe_ledger(PeerId peer) const {
    return const_cast<Pipe&>(pipe).at(road).ledger(peer);
  }
  PeerLedger attackers() const { return pipe_ledger(attacker_at_road); }

  Pipe pipe;
  std::size_t honest = 0;
  std::size_t road = 1;
  Attacker attacker{pipe, 1, 2, kAttacker};
  PeerId honest_at_road{};
  PeerId attacker_at_road{};
  // Rounds of the honest vehicle: begun, answered by the road, answered later than usual.
  int begun = 0;
  int remote = 0;
  int late = 0;
  // Results that are not of the vehicle that they were sent to.
  int mixed = 0;
  std::vector<PeerLimited> limited;
  // Whether the road answers the attacker's rounds.
  bool serves_attacker = true;

 private:
  void note(std::size_t host, Event& event) {
    if (const auto* ready = std::get_if<PeerReady>(&event); ready != nullptr && host == road) {
      honest_at_road = ready->peer;
    }
    if (const auto* l = std::get_if<PeerLimited>(&event)) limited.push_back(*l);
    if (auto* delivered = std::get_if<Delivered>(&event); delivered != nullptr && host == road) {
      const bool is_honest = delivered->round.origin == SessionId{kHonest};
      mixed += is_honest != (delivered->payload.front() == kMark) ? 1 : 0;
      mixed += is_honest != (delivered->from == honest_at_road) ? 1 : 0;
      if (!is_honest && !serves_attacker) return;
      // The result is what came, so that whose it is can be seen at its end.
      pipe.plan(20ms, [this, ref = delivered->round, payload = delivered->payload.front()] {
        pipe.at(road).submit(pipe.local(road), ref, {Bytes(100, payload)}, MessageClass::kResult);
        pipe.flush(road);
      });
    }
    if (auto* done = std::get_if<RoundDone>(&event)) {
      remote += done->outcome == Outcome::kRemote ? 1 : 0;
      late += done->e2e > 100ms ? 1 : 0;
      mixed += !done->result.empty() && done->result.front() != kMark ? 1 : 0;
    }
  }
};

}  // namespace interneuron
