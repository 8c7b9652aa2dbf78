// Sessions where handshakes and first packets are lost or late, where there is no place, and where
// a trusted host means harm.
#include <gtest/gtest.h>

#include "core/code/field.h"
#include "core/code/window.h"
#include "core/secure/credential.h"
#include "core/secure/handshake.h"
#include "core/secure/session.h"
#include "core/wire/source.h"
#include "encrypted.h"

namespace interneuron::sessions_test {
namespace {

constexpr std::uint32_t kFirstLife = 100;

EndpointOptions vehicle_of(int key) {
  EndpointOptions o =
      options_of(kFirstLife + static_cast<std::uint32_t>(key), {pipeline_of(kOffload)}, false);
  o.security = sim::security_of(key, {kRoadKey});
  return o;
}

bool is_of(wire::PacketType type, ByteView bytes) {
  const auto header = wire::peek(bytes);
  return header && header->type == type;
}

// A vehicle and a roadside unit over one link of 150 ms each way.
struct SlowPair {
  Pipe pipe;
  std::size_t vehicle = pipe.add_host(vehicle_of(kVehicleKey));
  std::size_t road = pipe.add_host(Encrypted::road_options({kVehicleKey}));
  int initiations = 0;
  int unauthentic() {
    return static_cast<int>(pipe.at(road).link_counters(kFast).unauthentic_packets);
  }

  SlowPair() {
    pipe.delay[kFast] = 150ms;
    pipe.cut = {kSlow};
  }
  void count(ByteView bytes) { initiations += is_of(wire::PacketType::kInitiation, bytes) ? 1 : 0; }
};

TEST(Sessions, ALostProofOfAddressCostsNoSession) {
  SlowPair s;
  int tokens = 0;
  s.pipe.drop = [&](std::size_t from, LinkId, ByteView bytes) {
    return from == s.vehicle && is_of(wire::PacketType::kToken, bytes) && ++tokens == 1;
  };
  s.pipe.connect(s.vehicle, s.road);
  s.pipe.run(2s);
  ASSERT_EQ(s.pipe.at(s.road).peers().size(), 1U);
  const int before = s.unauthentic();
  s.pipe.run(10s);
  EXPECT_EQ(s.unauthentic(), before);
  EXPECT_EQ(s.pipe.at(s.vehicle).links(s.pipe.local(s.vehicle), PeerId{1}).front().path,
            PathState::kOk);
}

TEST(Sessions, WhoFindsNoPlaceDoesNotHammer) {
  Pipe pipe;
  EndpointOptions options = Encrypted::road_options({3, 4});
  options.max_peers = 1;
  const std::size_t road = pipe.add_host(std::move(options));
  const std::size_t first = pipe.add_host(vehicle_of(3));
  const std::size_t second = pipe.add_host(vehicle_of(4));
  int responses = 0;
  pipe.drop = [&](std::size_t from, LinkId, ByteView bytes) {
    responses += from == road && is_of(wire::PacketType::kResponse, bytes) ? 1 : 0;
    return false;
  };
  pipe.connect(first, road);
  pipe.run(1s);
  responses = 0;
  pipe.connect(second, road);
  pipe.run(60s);
  EXPECT_EQ(pipe.at(road).peers().size(), 1U);
  // Over two paths each.
  EXPECT_LE(responses, 2 * 15);
}

TEST(Sessions, SealedPacketsThatVanishAreAskedForEverMoreRarely) {
  SlowPair s;
  s.pipe.drop = [&](std::size_t from, LinkId, ByteView bytes) {
    s.count(bytes);
    return from == s.road && wire::peek(bytes)->epoch == wire::kSealedEpoch;
  };
  s.pipe.connect(s.vehicle, s.road);
  s.pipe.run(60s);
  // Each handshake takes three tries, which 300 ms lie between.
  EXPECT_LE(s.initiations, 3 * 16);
  EXPECT_GE(s.initiations, 12);
}

// --- time

TEST(Sessions, CredentialsAreJudgedByAClockThatWasSetLater) {
  const SecretKey authority = sim::secret_key(50);
  constexpr std::int64_t kIssued_s = 1'000'000;
  Pipe pipe;
  EndpointOptions unit = options_of(22);
  Security trusting = *sim::security_of(kRoadKey, {});
  trusting.authorities = {crypto::authority_key_of(authority)};
  unit.security = std::make_shared<Security>(trusting);
  EndpointOptions options = vehicle_of(3);
  Security own = *options.security;
  own.credential = crypto::sign_credential(
      {sim::key_of_host(3), NodeRole::kVehicle, "v", kIssued_s, 2 * kIssued_s}, authority);
  options.security = std::make_shared<Security>(own);
  const std::size_t road = pipe.add_host(unit);
  const std::size_t vehicle = pipe.add_host(options);
  pipe.connect(vehicle, road);
  pipe.run(10s);
  EXPECT_TRUE(pipe.at(road).peers().empty());
  pipe.at(road).raise_unix_time_ns(pipe.local(road), kIssued_s * 1'000'000'000);
  // One that is set back changes nothing.
  pipe.at(road).raise_unix_time_ns(pipe.local(road), 0);
  pipe.run(10s);
  EXPECT_EQ(pipe.at(road).peers().size(), 1U);
}

TEST(Sessions, WhoIsToldAnAbsurdTimeIsStillHeardByOthers) {
  Pipe pipe;
  EndpointOptions liar = Encrypted::road_options({3});
  Security security = *liar.security;
  security.unix_time_ns = crypto::kLatestUnixNs - Duration(24h).count();
  liar.security = std::make_shared<Security>(security);
  const std::size_t vehicle = pipe.add_host(vehicle_of(3));
  const std::size_t road = pipe.add_host(liar);
  pipe.connect(vehicle, road);
  pipe.run(1s);
  EXPECT_EQ(pipe.at(road).peers().size(), 1U);
  const std::int64_t told = pipe.at(vehicle).unix_time_ns(pipe.local(vehicle));
  EXPECT_GT(told, crypto::kLatestUnixNs / 2);
  EXPECT_LT(told, crypto::kLatestUnixNs - std::int64_t{86'400'000'000'000} * 365 * 10);
}

// --- a trusted host that writes its packets itself

class Insider {
 public:
  static constexpr int kKey = 3;
  // `made`: so many handshakes it has made before.
  explicit Insider(Endpoint& unit, TimePoint now, std::uint32_t made = 0)
      : unit_(unit), now_(now), made_(made) {}

  // A new session, and the token of the response, which proves our address.
  wire::Token shake_hands(std::uint32_t life) {
    crypto::Initiator asks(crypto::key_pair_of(sim::secret_key(kKey)),
                           {sim::key_of_host(kRoadKey), {}}, SessionId{life});
    asks.begin(now_);
    ++made_;
    EXPECT_TRUE(
        asks.make_message(now_, {made_, sim::secret_key(60 + static_cast<int>(made_)), made_, 0}));
    std::array<std::byte, kMaxDatagramBytes> buffer{};
    hand_over(std::span(buffer).first(asks.write(LinkId{0}, buffer)));
    while (const auto sent = unit_.poll_transmit(now_, buffer)) {
      const ByteView answer = std::span(buffer).first(sent->size);
      if (const auto agreed = asks.take_response(answer)) {
        session_.emplace(now_, crypto::Session::Role::kInitiator, agreed->theirs.index,
                         agreed->keys);
        number_ = 0;
        const auto token = asks.token_of(answer);
        // Whoever repeats the response has nothing answered.
        EXPECT_FALSE(asks.token_of(answer));
        return token.value();
      }
    }
    ADD_FAILURE() << "no response";
    return {};
  }
  void prove(const wire::Token& token) {
    send([&](std::span<std::byte> out,
             const wire::PacketHeader& header) { return wire::write_token(out, header, token); },
         wire::PacketType::kToken);
  }
  // A message of one piece, told by a symbol alone; two symbols tell of two.
  void send_symbols(ByteView message) {
    for (std::uint8_t row = 0; row < 2; ++row) {
      wire::WindowHeader window;
      window.row = row;
      Bytes symbol(wire::kSourceHeaderBytes + message.size());
      for (std::uint32_t m = 1; m <= 2; ++m) window.messages.push_back({MessageId{m}, 1});
      window.for_each([&](std::size_t column, MessageId id, std::uint8_t) {
        Bytes source(symbol.size());
        const auto head = wire::source_header({id, 0, static_cast<std::uint16_t>(message.size()),
                                               static_cast<std::uint32_t>(message.size()),
                                               1'000'000, wire::MessageKind::kRevocations});
        std::ranges::copy(head, source.begin());
        std::ranges::copy(message, source.begin() + static_cast<std::ptrdiff_t>(head.size()));
        code::add_multiple(symbol, source, code::coefficient(row, column));
      });
      send(
          [&](std::span<std::byte> out, const wire::PacketHeader& header) {
            return wire::write_window(out, header, window, symbol);
          },
          wire::PacketType::kWindow);
    }
  }

 private:
  template <class Write>
  void send(const Write& write, wire::PacketType type) {
    std::array<std::byte, kMaxDatagramBytes> buffer{};
    const wire::PacketHeader header{type, LinkId{0}, wire::kClearEpoch, SessionId{1}, ++number_, 0};
    const std::span<std::byte> packet = std::span(buffer).first(write(buffer, header));
    ASSERT_TRUE(session_->seal(packet));
    hand_over(packet);
  }
  void hand_over(ByteView packet) {
    Address from;
    from.raw[0] = std::byte{9};
    from.size = 1;
    unit_.handle_datagram(now_, {kFast, from, packet});
  }

  Endpoint& unit_;
  TimePoint now_;
  std::uint32_t made_;
  std::uint64_t number_ = 0;
  std::optional<crypto::Session> session_;
};

struct Attacked {
  static constexpr TimePoint kNow{1000s};
  const SecretKey authority = sim::secret_key(50);
  // Names the insider.
  const Bytes list = crypto::sign_revocations({1000, {sim::key_of_host(Insider::kKey)}}, authority);
  Endpoint unit{options(), kNow};
  Insider insider{unit, kNow};

  Attacked() { unit.add_link(kNow, kFast, {"fast", 1500, {}}); }
  EndpointOptions options() const {
    EndpointOptions o = options_of(22);
    Security s = *sim::security_of(kRoadKey, {Insider::kKey});
    s.authorities = {crypto::authority_key_of(authority)};
    o.security = std::make_shared<Security>(s);
    return o;
  }
};

TEST(Sessions, AListThatPutsItsSenderOutMayComeInAnyPacket) {
  Attacked a;
  a.insider.prove(a.insider.shake_hands(77));
  ASSERT_EQ(a.unit.peers().size(), 1U);
  a.insider.send_symbols(a.list);
  EXPECT_TRUE(a.unit.peers().empty());
}

// A host that has shaken hands twice proves its address with the keys of the first time, and seals
// with those of the second from then on.
TEST(Sessions, OneThatIsProvedLateKeepsTheOneThatFollowed) {
  Attacked a;
  const wire::Token first = a.insider.shake_hands(77);
  Insider again{a.unit, Attacked::kNow, 1};
  const wire::Token second = again.shake_hands(77);
  a.insider.prove(first);
  ASSERT_EQ(a.unit.peers().size(), 1U);
  again.prove(second);
  EXPECT_EQ(a.unit.link_counters(kFast).unauthentic_packets, 0U);
}

// It may seal with the keys of a second handshake while our answer to a third is on its way.
TEST(Sessions, OneThatIsRenewedTwiceKeepsTheKeysBetween) {
  Attacked a;
  a.insider.prove(a.insider.shake_hands(77));
  Insider second{a.unit, Attacked::kNow, 1};
  const wire::Token token = second.shake_hands(77);
  Insider third{a.unit, Attacked::kNow, 2};
  third.shake_hands(77);
  second.prove(token);
  EXPECT_EQ(a.unit.link_counters(kFast).unauthentic_packets, 0U);
}

TEST(Sessions, NobodyJoinsWithASessionFromBeforeHisKeyWasRevoked) {
  Attacked a;
  a.insider.prove(a.insider.shake_hands(77));
  ASSERT_EQ(a.unit.peers().size(), 1U);
  Insider again{a.unit, Attacked::kNow, 1};
  const wire::Token token = again.shake_hands(78);
  a.insider.send_symbols(a.list);
  ASSERT_TRUE(a.unit.peers().empty());
  again.prove(token);
  EXPECT_TRUE(a.unit.peers().empty());
}

}  // namespace
}  // namespace interneuron::sessions_test
