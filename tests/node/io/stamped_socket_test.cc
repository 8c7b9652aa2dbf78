#include "node/io/stamped_socket.h"

#include <gtest/gtest.h>
#include <poll.h>

#include "node/io/steady_clock.h"
#include "tests/node/io/support.h"

namespace interneuron::io::stamped_socket_test {
namespace {

StampedSocket on_loopback(const std::string& host) {
  UdpOptions options{.nic = "lo", .local = *make_address(host, 0)};
  return StampedSocket(options);
}

bool readable(const StampedSocket& socket) {
  pollfd item{socket.native_handle(), POLLIN, 0};
  return ::poll(&item, 1, static_cast<int>(std::chrono::milliseconds(kPatience).count())) == 1;
}

TEST(StampedSocket, SaysWhenTheKernelHadADatagramAndItsTtl) {
  StampedSocket socket = on_loopback("127.0.0.1");
  const Bytes bytes = payload(1, 100);
  TimePoint before;
  std::optional<StampedSocket::Received> received;
  // The kernel begins to stamp a little after it was asked to.
  for (int i = 0; i < 3; ++i) {
    before = now();
    ASSERT_EQ(socket.send(socket.local_address(), bytes), 0);
    ASSERT_TRUE(readable(socket));
    received = socket.receive();
    ASSERT_TRUE(received);
  }
  const TimePoint after = now();
  EXPECT_TRUE(std::ranges::equal(received->bytes, bytes));
  EXPECT_EQ(received->from, socket.local_address());
  EXPECT_EQ(received->ttl, 64);
  // Two clocks are read one after the other for it.
  EXPECT_GE(received->at, before - std::chrono::milliseconds(1));
  EXPECT_LE(received->at, after);
}

// How long a datagram that lies in the buffer for 20 ms seems to have come after it was there.
Duration stamped_late(StampedSocket& socket) {
  socket.send(socket.local_address(), payload(1, 100));
  if (!readable(socket)) return Duration::max();
  const TimePoint there = now();
  while (now() - there < std::chrono::milliseconds(20)) {
  }
  const auto received = socket.receive();
  return received ? received->at - there : Duration::max();
}

TEST(StampedSocket, TheStampIsOfTheArrivalNotOfTheReading) {
  StampedSocket socket = on_loopback("127.0.0.1");
  // The kernel switches its stamps on when it finds the time.
  const TimePoint began = now();
  Duration late = stamped_late(socket);
  while (late > std::chrono::milliseconds(1) && now() - began < kPatience) {
    late = stamped_late(socket);
  }
  EXPECT_LE(late, std::chrono::milliseconds(1));
}

TEST(StampedSocket, EachDatagramComesByItself) {
  StampedSocket socket = on_loopback("127.0.0.1");
  for (std::size_t i = 0; i < 20; ++i) {
    ASSERT_EQ(socket.send(socket.local_address(), payload(i, 100)), 0);
  }
  for (std::size_t i = 0; i < 20; ++i) {
    ASSERT_TRUE(readable(socket));
    const auto received = socket.receive();
    ASSERT_TRUE(received);
    EXPECT_TRUE(std::ranges::equal(received->bytes, payload(i, 100)));
  }
  EXPECT_FALSE(socket.receive());
}

TEST(StampedSocket, AnAnswerLeavesFromTheAddressThatWasAsked) {
  for (const auto& [any, asked] : {std::pair{"0.0.0.0", "127.0.0.2"}, std::pair{"::", "::1"}}) {
    UdpOptions options{.nic = "lo", .local = *make_address(any, 0), .answer_from_receiver = true};
    StampedSocket reflector(options);
    StampedSocket asking = on_loopback(asked == std::string("::1") ? "::1" : "127.0.0.1");
    const Address to = *make_address(asked, port_of(reflector.local_address()));
    ASSERT_EQ(asking.send(to, payload(1, 10)), 0);
    ASSERT_TRUE(readable(reflector));
    const auto request = reflector.receive();
    ASSERT_TRUE(request);
    EXPECT_EQ(request->to, *make_address(asked, 0));
    ASSERT_EQ(reflector.send(request->from, payload(2, 10), request->to), 0);
    ASSERT_TRUE(readable(asking));
    const auto answer = asking.receive();
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->from, to);
    EXPECT_EQ(answer->to.size, 0) << "not asked for";
  }
}

TEST(StampedSocket, AnErrorOfSendingIsToldByItsNumber) {
  StampedSocket socket = on_loopback("127.0.0.1");
  EXPECT_NE(socket.send(*make_address("127.0.0.1", 9), Bytes(70'000)), 0);
}

}  // namespace
}  // namespace interneuron::io::stamped_socket_test
