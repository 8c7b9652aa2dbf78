// Echoes to an endpoint that encrypts, from one who is not its peer.
#include "core/secure/caller.h"

#include <gtest/gtest.h>

#include "core/wire/packet.h"
#include "lab/sim/trust.h"

namespace interneuron::crypto::caller_test {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kNic{1};
constexpr LinkId kPath{3};

Bytes echo(std::uint64_t number) {
  Bytes out(kMaxDatagramBytes);
  wire::Echo request;
  request.request.error_estimate = 1;
  out.resize(wire::write_echo(
      out, {wire::PacketType::kEcho, kPath, wire::kClearEpoch, SessionId{9}, number, 0}, request,
      200));
  return out;
}

// The side that is called, by its sessions alone.
struct Called {
  Sessions sessions;
  std::array<std::byte, kMaxDatagramBytes> opened{};

  explicit Called(TimePoint now) : sessions(*sim::security_of(2, {1}), SessionId{22}, true, now) {}
  Bytes answer(TimePoint now, const Bytes& datagram) {
    const auto header = wire::peek(datagram);
    EXPECT_TRUE(sessions.take_handshake(now, *header, {kNic, {}, datagram}).is_used);
    Bytes out(kMaxDatagramBytes);
    EXPECT_TRUE(sessions.responder().next());
    out.resize(sessions.responder().write(out, {}));
    return out;
  }
};

TEST(Caller, SealsAndOpensWhatWasWrittenInTheClear) {
  TimePoint now{1h};
  Caller caller(now, *sim::security_of(1, {2}), SessionId{9});
  Called called(now);
  Bytes out(kMaxDatagramBytes);
  std::uint64_t number = 0;
  int handshakes = 0;
  // Ten minutes, over several renewals of the keys.
  for (const TimePoint end = now + 10min; now < end; now += 100ms) {
    while (caller.is_due(now)) {
      ++handshakes;
      const std::size_t size = caller.write(kPath, out);
      caller.sent(now);
      EXPECT_FALSE(caller.handle(
          now, called.answer(now, Bytes(out.begin(), out.begin() + static_cast<long>(size)))));
    }
    ASSERT_TRUE(caller.is_open(now));
    const Bytes clear = echo(++number);
    Bytes sealed = clear;
    ASSERT_TRUE(caller.seal(now, sealed));
    const auto by = called.sessions.open(now, *wire::peek(sealed), sealed, called.opened);
    ASSERT_EQ(by.result, Session::Opened::kOk);
    EXPECT_FALSE(by.owner);
    EXPECT_EQ(by.who, sim::key_of_host(1));
    Bytes back = clear;
    ASSERT_TRUE(called.sessions.seal_with(now, wire::peek(sealed)->session.value, back));
    const auto read = caller.handle(now, back);
    ASSERT_TRUE(read);
    const auto packet = wire::parse(*read);
    ASSERT_TRUE(packet);
    EXPECT_EQ(packet->header.type, wire::PacketType::kEcho);
    EXPECT_FALSE(caller.handle(now, back));
    EXPECT_FALSE(caller.handle(now, clear));
  }
  EXPECT_GE(handshakes, 5);
  EXPECT_LE(handshakes, 6);
}

TEST(Caller, HasToKnowWhomItCalls) {
  EXPECT_THROW(Caller(TimePoint{}, *sim::security_of(1, {}), SessionId{9}), std::invalid_argument);
  EXPECT_THROW(Caller(TimePoint{}, *sim::security_of(1, {2, 3}), SessionId{9}),
               std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::crypto::caller_test
