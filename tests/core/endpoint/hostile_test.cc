// The peer's bytes never throw, are always counted, and never make the endpoint hold more than its
// bounds.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <deque>
#include <random>

#include "core/flow/reassembler.h"
#include "core/wire/packet.h"
#include "core/wire/round_header.h"
#include "interneuron/endpoint.h"
#include "pipe.h"

namespace interneuron::hostile_test {
namespace {

constexpr std::uint32_t kVehicleSession = 1;
constexpr std::uint32_t kRoadSession = 2;

// What flies between a vehicle and a roadside while they work.
std::vector<Pipe::Captured> valid_traffic() {
  Pipe pipe;
  std::vector<Pipe::Captured> out;
  pipe.capture = &out;
  pipe.add_host(options_of(kVehicleSession, {pipeline_of({kComm, kComm})}, false));
  pipe.add_host(options_of(kRoadSession));
  pipe.on_event = [&pipe](std::size_t host, Event& e) {
    if (auto* d = std::get_if<Delivered>(&e)) pipe.submit(host, d->round, 100);
  };
  pipe.connect(0, 1);
  pipe.run(500ms);
  for (int i = 0; i < 5; ++i) {
    pipe.round(0, PipelineId{0}, {Bytes(6000), Bytes(1500)});
    pipe.run(100ms);
  }
  return out;
}

// An endpoint under fire: every datagram is checked to be counted exactly once, and every turn to
// end in a sleep.
struct Target {
  struct Owed {
    LinkId link{};
    std::size_t from = 0;
    Bytes token;
  };
  Endpoint endpoint;
  TimePoint now{1h};
  std::uint64_t fed = 0;
  std::size_t max_peers;
  std::deque<Owed> owed;

  explicit Target(bool vehicle, std::size_t peers = 8)
      : endpoint(make(vehicle, peers)), max_peers(peers) {
    for (const LinkId link : {kFast, kSlow}) endpoint.add_link(now, link, {"nic", 1500});
    if (vehicle) {
      const std::pair<LinkId, Address> to[] = {{kFast, address_of(1)}, {kSlow, address_of(1)}};
      endpoint.connect(now, to);
      drain();
      // The roadside unit shows that it has heard us.
      wire::Feedback heard;
      heard.echo = SessionId{kVehicleSession};
      std::array<std::byte, 200> out;
      const std::size_t size = wire::write_feedback(
          out, {wire::PacketType::kFeedback, kFast, 0, SessionId{kRoadSession}, 1}, heard);
      feed(kFast, 1, std::span(out).first(size));
    }
  }
  static Endpoint make(bool vehicle, std::size_t peers) {
    EndpointOptions o = vehicle ? options_of(kVehicleSession, {pipeline_of({kComm, kComm})}, false)
                                : options_of(kRoadSession);
    o.max_peers = peers;
    return Endpoint(std::move(o), TimePoint{1h});
  }
  void feed(LinkId link, std::size_t from, ByteView bytes) {
    endpoint.handle_datagram(now, {link, address_of(from), bytes});
    ++fed;
    drain();
  }
  void drain() {
    std::array<std::byte, kMaxDatagramBytes> buffer;
    for (int turn = 0; turn < 2; ++turn) {
      while (auto event = endpoint.poll_event()) {
        if (auto* d = std::get_if<Delivered>(&*event)) {
          endpoint.submit(now, d->round, {Bytes(50)}, MessageClass::kResult);
        }
      }
      while (const auto transmit = endpoint.poll_transmit(now, buffer)) {
        note_challenge(*transmit, std::span(buffer).first(transmit->size));
      }
    }
    while (!owed.empty()) {
      const Owed next = owed.front();
      owed.pop_front();
      feed(next.link, next.from, next.token);
    }
  }
  // Whoever asked answers the challenge.
  void note_challenge(const Transmit& transmit, ByteView bytes) {
    const auto packet = wire::parse(bytes);
    if (!packet || packet->header.type != wire::PacketType::kChallenge) return;
    wire::PacketHeader header = packet->header;
    header.type = wire::PacketType::kToken;
    header.session = packet->challenge.echo;
    Bytes token(wire::kPacketOverhead + wire::kTokenBytes);
    wire::write_token(token, header, packet->challenge.token);
    owed.push_back({transmit.link, std::to_integer<std::size_t>(transmit.to.raw[0]), token});
  }
  // Time goes on by `by`, as a loop would let it.
  void sleep(Duration by) {
    const TimePoint end = now + by;
    for (int turns = 0; turns < 10'000; ++turns) {
      const auto next = endpoint.next_timeout();
      if (!next || *next > end) break;
      now = std::max(now, *next);
      endpoint.handle_timeout(now);
      drain();
      const auto after = endpoint.next_timeout();
      ASSERT_TRUE(!after || *after > now) << "the loop spins";
    }
    now = end;
  }
  std::uint64_t counted() const {
    std::uint64_t sum = 0;
    for (int link = 0; link < 256; ++link) {
      const LinkCounters c = endpoint.link_counters(LinkId{static_cast<std::uint8_t>(link)});
      sum += c.received_packets + c.duplicate_packets + c.malformed_packets + c.refused_packets +
             c.other_version_packets + c.other_packets;
    }
    return sum;
  }
  void check() const {
    EXPECT_EQ(counted(), fed);
    EXPECT_LE(endpoint.reassembly_bytes(), (max_peers + 1) * flow::Reassembler::kMaxBytes);
    EXPECT_LE(endpoint.peers().size(), max_peers + 1);
  }
};

class Hostile : public testing::TestWithParam<bool> {};

TEST_P(Hostile, RandomDatagrams) {
  Target t(GetParam());
  std::mt19937_64 rng(1);
  for (int i = 0; i < 20'000; ++i) {
    Bytes bytes(rng() % 200);
    for (std::byte& b : bytes) b = static_cast<std::byte>(rng());
    t.feed(LinkId{static_cast<std::uint8_t>(rng() % 4)}, rng() % 4, bytes);
    if (i % 100 == 0) t.sleep(3ms);
  }
  t.check();
  EXPECT_EQ(t.endpoint.peers().size(), GetParam() ? 1U : 0U);
}

TEST_P(Hostile, MutatedDatagrams) {
  const auto traffic = valid_traffic();
  ASSERT_GT(traffic.size(), 50U);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Target t(GetParam());
    std::mt19937_64 rng(seed);
    for (int i = 0; i < 10'000; ++i) {
      const Pipe::Captured& c = traffic[rng() % traffic.size()];
      Bytes bytes = c.bytes;
      const std::size_t flips = rng() % 4;  // none: replayed
      for (std::size_t f = 0; f < flips; ++f) {
        // The headers rather than the padding.
        bytes[rng() % std::min<std::size_t>(bytes.size(), 112)] = static_cast<std::byte>(rng());
      }
      if (rng() % 20 == 0) bytes.resize(rng() % (bytes.size() + 1));
      t.feed(c.link, rng() % 3, bytes);
      if (i % 50 == 0) t.sleep(Duration{static_cast<std::int64_t>(rng() % 30'000'000)});
    }
    t.check();
  }
}

INSTANTIATE_TEST_SUITE_P(VehicleAndRoad, Hostile, testing::Bool(),
                         [](const auto& which) { return which.param ? "Vehicle" : "Road"; });

// --- valid packets with any fields

template <class T>
T any_of(std::mt19937_64& rng, std::initializer_list<T> likely) {
  if (rng() % 4 != 0) return *(likely.begin() + static_cast<std::ptrdiff_t>(rng() % likely.size()));
  return static_cast<T>(rng());
}

std::int64_t any_time(std::mt19937_64& rng, TimePoint now) {
  const std::int64_t n = now.time_since_epoch().count();
  return any_of<std::int64_t>(rng,
                              {0, n, n - 50'000'000, n + 50'000'000, INT64_MAX, INT64_MIN, -1});
}

Bytes any_message(std::mt19937_64& rng, TimePoint now) {
  wire::RoundHeader h;
  h.stages = static_cast<std::uint8_t>(1 + rng() % kMaxStages);
  h.stage = static_cast<std::uint8_t>(1 + rng() % h.stages);
  h.communication = static_cast<std::uint16_t>(rng() | (1U << (h.stage - 1)));
  h.round = {SessionId{any_of<std::uint32_t>(rng, {kVehicleSession, kRoadSession, 3, 4}) | 1U},
             PipelineId{any_of<std::uint8_t>(rng, {0, 1})},
             RoundId{any_of<std::uint32_t>(rng, {0, 1, 2, 64, UINT32_MAX})}};
  h.variant = static_cast<std::uint8_t>(rng() % kMaxVariants);
  h.best_planned = static_cast<std::uint8_t>(rng() % (h.variant + 1U));
  h.degraded = rng() % 2 == 0;
  h.message_class = static_cast<MessageClass>(rng() % 2);
  h.policy = rng() % 2 == 0 ? wire::policy_id("down_sampling") : static_cast<std::uint32_t>(rng());
  h.t0 = PeerTime{Duration{any_time(rng, now)}};
  h.alpha_sum = Duration{any_time(rng, now)};
  h.x_permille = static_cast<std::int16_t>(static_cast<int>(rng() % 33'767) - 1000);
  h.deadline_us = any_of<std::uint32_t>(rng, {1, 130'000, UINT32_MAX}) | 1U;
  h.period_us = any_of<std::uint32_t>(rng, {0, 100'000, UINT32_MAX});
  for (RoundState& s : h.indicator) s = static_cast<RoundState>(rng() % 3);
  h.guard = rng() % 2 == 0 ? GuardKind::kBudget : GuardKind::kPaper;
  h.level_used = static_cast<std::uint8_t>(rng());
  h.variant_used = rng() % 2 == 0 ? wire::kNoneUsed : static_cast<std::uint8_t>(rng() % 8);
  h.excess = static_cast<std::int16_t>(rng());
  h.computed = static_cast<std::uint16_t>(rng());
  for (std::uint16_t& e2e : h.e2e) e2e = static_cast<std::uint16_t>(rng());
  Bytes out(wire::kRoundHeaderBytes + rng() % 300);
  wire::write_round_header(std::span(out).first<wire::kRoundHeaderBytes>(), h);
  return out;
}

std::size_t any_packet(std::mt19937_64& rng, TimePoint now, std::span<std::byte> out) {
  wire::PacketHeader h{.link = LinkId{any_of<std::uint8_t>(rng, {0, 1})}};
  h.session =
      SessionId{std::max(1U, any_of<std::uint32_t>(rng, {kVehicleSession, kRoadSession, 3, 4}))};
  h.number = std::max<std::uint64_t>(
      1, any_of<std::uint64_t>(rng, {rng() % 1'000'000, rng() % 1'000'000, UINT64_MAX}));
  switch (rng() % 4) {
    case 0: {
      h.type = wire::PacketType::kFeedback;
      wire::Feedback f;
      f.u = any_time(rng, now);
      f.echo = SessionId{any_of<std::uint32_t>(rng, {kVehicleSession, kRoadSession})};
      for (auto n = rng() % (wire::kMaxReports + 1); n > 0; --n) f.reports.push_back({});
      for (wire::LinkReport& r : f.reports) {
        r.link = LinkId{any_of<std::uint8_t>(rng, {0, 1})};
        r.has_exchange = rng() % 2 == 0;
        r.s = PeerTime{Duration{any_time(rng, now)}};
        r.h = Duration{any_time(rng, now) & INT64_MAX};
        r.largest = any_of<std::uint64_t>(rng, {0, 1, 10, 1000});
        for (std::uint64_t& word : r.bitmap) word = rng();
        r.train_start = rng();
        r.train_packets = static_cast<std::uint32_t>(rng());
        r.train_rate = {static_cast<std::int64_t>(rng() & UINT32_MAX) * 1000};
      }
      return wire::write_feedback(out, h, f);
    }
    case 1:
      h.type = wire::PacketType::kProbe;
      return wire::write_probe(out, h, rng() % 1400);
    case 2: {  // a piece of something that never completes
      h.type = wire::PacketType::kData;
      wire::FragmentHeader f{.message = MessageId{static_cast<std::uint32_t>(rng())},
                             .chunk = static_cast<std::uint16_t>(1 + rng() % 1300)};
      f.size = static_cast<std::uint32_t>((2 + rng() % 65'000) * f.chunk);
      f.index = static_cast<std::uint16_t>(rng() % (f.count() - 1U));
      f.lifetime_us = any_of<std::uint32_t>(rng, {0, 1000, UINT32_MAX});
      Bytes piece = any_message(rng, now);
      piece.resize(f.chunk);
      return wire::write_data(out, h, f, piece);
    }
    default: {
      h.type = wire::PacketType::kData;
      const Bytes message = any_message(rng, now);
      wire::FragmentHeader f{.message = MessageId{static_cast<std::uint32_t>(rng())},
                             .chunk = static_cast<std::uint16_t>(message.size())};
      f.size = f.chunk;
      f.lifetime_us = 130'000;
      return wire::write_data(out, h, f, message);
    }
  }
}

void under_fire(bool vehicle, std::uint64_t seed, int packets) {
  Target t(vehicle);
  std::mt19937_64 rng(seed);
  std::array<std::byte, 2048> buffer;
  for (int i = 0; i < packets; ++i) {
    if (vehicle && i % 50 == 0) {
      const RoundRef ref = t.endpoint.begin_round(t.now, PipelineId{0});
      t.endpoint.submit(t.now, ref, {Bytes(5000), Bytes(1000)}, MessageClass::kData);
      t.drain();
    }
    const std::size_t size = any_packet(rng, t.now, buffer);
    t.feed(LinkId{static_cast<std::uint8_t>(rng() % 2)}, 1 + rng() % 2,
           std::span(buffer).first(size));
    if (rng() % 10 == 0) t.sleep(Duration{static_cast<std::int64_t>(rng() % 5'000'000)});
    // The host's clock may go back as well.
    if (rng() % 500 == 0) t.now -= 10ms;
  }
  t.check();
}

TEST_P(Hostile, ValidPacketsWithAnyFields) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) under_fire(GetParam(), seed, 4'000);
}

RC_GTEST_PROP(HostileProperty, EveryDatagramIsCountedOnce, (bool vehicle, std::uint64_t seed)) {
  under_fire(vehicle, seed, 100);
  RC_ASSERT(!testing::Test::HasFailure());
}

// Sockets take in datagrams of up to 64 KiB. A piece and a repair symbol of 20,000 bytes each would
// bring back the other piece, by arithmetic whose room is for what fits into one datagram of ours.
TEST_P(Hostile, PiecesAndSymbolsThatAreLongerThanAnyDatagram) {
  Target t(GetParam());
  constexpr std::uint16_t kLong = 20'000;
  Bytes out(UINT16_MAX);
  for (const std::uint16_t index : {std::uint16_t{0}, std::uint16_t{2}}) {
    const std::size_t size = wire::write_data(
        out, {wire::PacketType::kData, kFast, 0, SessionId{3}, index + 1ULL},
        {MessageId{1}, index, kLong, 2 * kLong, 1'000'000, wire::MessageKind::kPlain},
        Bytes(kLong, std::byte{0x41}));
    t.feed(kFast, 1, ByteView(out).first(size));
  }
  t.check();
  EXPECT_EQ(t.endpoint.link_counters(kFast).malformed_packets, 2U);
  EXPECT_EQ(t.endpoint.reassembly_bytes(), 0U);
}

// The road is heard and has heard us, so that the vehicle may send, which begins a round.
RoundRef begin_round(Target& t) {
  wire::Feedback feedback;
  feedback.echo = SessionId{kVehicleSession};
  feedback.reports.push_back({});
  feedback.reports.front().link = kFast;
  std::array<std::byte, kMaxDatagramBytes> out;
  const std::size_t size = wire::write_feedback(
      out, {wire::PacketType::kFeedback, kFast, 0, SessionId{kRoadSession}, 1}, feedback);
  t.feed(kFast, 1, std::span(out).first(size));
  const RoundRef round = t.endpoint.begin_round(t.now, PipelineId{0});
  EXPECT_EQ(t.endpoint.submit(t.now, round, {Bytes(10)}, MessageClass::kData),
            SubmitStatus::kAccepted);
  return round;
}

// A round of ours that comes back in the middle may say anything of when it began.
TEST(HostileRounds, ARoundOfOursMayComeBackWithAnyBeginning) {
  for (const std::int64_t t0 : {INT64_MIN, INT64_MIN + 7'200'000'000'000, INT64_MAX, -1L, 0L}) {
    Target t(true);
    wire::RoundHeader h{.round = begin_round(t),
                        .stage = 1,
                        .stages = 2,
                        .communication = 0b11,
                        .policy = wire::policy_id("joint"),
                        .t0 = PeerTime{Duration{t0}},
                        .deadline_us = UINT32_MAX};
    Bytes bytes(wire::kRoundHeaderBytes + 5);
    wire::write_round_header(std::span(bytes).first<wire::kRoundHeaderBytes>(), h);
    std::array<std::byte, 200> out;
    const std::size_t size =
        wire::write_data(out, {wire::PacketType::kData, kFast, 0, SessionId{kRoadSession}, 2},
                         {MessageId{1}, 0, static_cast<std::uint16_t>(bytes.size()),
                          static_cast<std::uint32_t>(bytes.size()), 130'000},
                         bytes);
    // It is delivered, and what the application answers is submitted.
    t.feed(kFast, 1, std::span(out).first(size));
    EXPECT_EQ(t.endpoint.counters().messages_completed, 1U);
  }
}

// A peer that claims rounds which have not begun must not push those that did out of the books.
TEST(HostileRounds, ResultsOfRoundsThatNeverBeganAreBad) {
  Target t(true);
  const auto result = [&t](std::uint64_t number, std::uint32_t message, std::uint32_t round) {
    wire::RoundHeader h{.round = {SessionId{kVehicleSession}, PipelineId{0}, RoundId{round}}};
    h.stage = h.stages = 2;
    h.communication = 0b11;
    h.deadline_us = 130'000;
    Bytes bytes(wire::kRoundHeaderBytes + 5);
    wire::write_round_header(std::span(bytes).first<wire::kRoundHeaderBytes>(), h);
    std::array<std::byte, 200> out;
    const std::size_t size =
        wire::write_data(out, {wire::PacketType::kData, kFast, 0, SessionId{kRoadSession}, number},
                         {MessageId{message}, 0, static_cast<std::uint16_t>(bytes.size()),
                          static_cast<std::uint32_t>(bytes.size()), 130'000},
                         bytes);
    t.endpoint.handle_datagram(t.now, {kFast, address_of(1), std::span(out).first(size)});
  };
  begin_round(t);
  result(11, 1, 64);  // shares the ring's slot of round 0
  result(12, 2, 1);
  EXPECT_EQ(t.endpoint.counters().bad_messages, 2U);
  result(13, 3, 0);
  std::vector<Outcome> outcomes;
  while (const auto event = t.endpoint.poll_event()) {
    if (const auto* done = std::get_if<RoundDone>(&*event)) outcomes.push_back(done->outcome);
  }
  EXPECT_EQ(outcomes, std::vector{Outcome::kRemote});
}

}  // namespace
}  // namespace interneuron::hostile_test
