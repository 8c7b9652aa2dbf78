#include "node/io/udp_socket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/net_tstamp.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include "node/io/steady_clock.h"
#include "support.h"

namespace interneuron::io::udp_transport_test {
namespace {

UdpOptions on_lo(const char* host = "127.0.0.1", std::uint16_t port = 0) {
  return UdpOptions{.nic = "lo", .local = *make_address(host, port)};
}

std::string error_of(const UdpOptions& options, int code) {
  try {
    UdpTransport transport(options);
  } catch (const IoError& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

void expect_round_trip(UdpTransport& sender, UdpTransport& receiver,
                       const std::vector<Bytes>& payloads) {
  const auto batch = to_all(receiver.local_address(), payloads);
  const BatchResult result = sender.send(batch);
  ASSERT_EQ(result.taken, batch.size());
  EXPECT_FALSE(result.would_block);
  EXPECT_EQ(result.gone, 0);
  EXPECT_EQ(receive_all(receiver, payloads.size()), payloads);
}

TEST(UdpTransport, EqualDatagramsLeaveInOneCallAndArriveInOrder) {
  UdpTransport sender(on_lo());
  UdpTransport receiver(on_lo());
  std::vector<Bytes> payloads;
  for (std::size_t i = 0; i < 200; ++i) payloads.push_back(payload(i, i == 199 ? 77 : 1200));
  expect_round_trip(sender, receiver, payloads);
  EXPECT_EQ(sender.counters().sent_datagrams, 200u);
  EXPECT_EQ(receiver.counters().received_datagrams, 200u);
  EXPECT_EQ(sender.counters().send_calls, sender.capabilities().segmentation_offload ? 1u : 7u);
}

// Receives until nothing makes the handle readable; returns how many calls that took.
int calls_until_quiet(UdpTransport& transport) {
  constexpr int kTooMany = 100;
  for (int calls = 0; calls < kTooMany; ++calls) {
    pollfd handle{transport.native_handle(), POLLIN, 0};
    if (::poll(&handle, 1, 0) == 0) return calls;
    EXPECT_TRUE(transport.receive().empty());
  }
  return kTooMany;
}

TEST(UdpTransport, ReportsOfTheErrorQueueAreReadAndCounted) {
  UdpTransport sender(on_lo());
  const UdpTransport receiver(on_lo());
  const int stamps = SOF_TIMESTAMPING_TX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  ASSERT_EQ(
      ::setsockopt(sender.native_handle(), SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps), 0);
  // Their sizes differ, so that each is a send of its own.
  std::vector<Bytes> payloads;
  for (std::size_t i = 0; i < 150; ++i) payloads.push_back(payload(i, 100 + i));
  ASSERT_EQ(sender.send(to_all(receiver.local_address(), payloads)).taken, payloads.size());
  ASSERT_TRUE(wait_for(sender, POLLERR));
  // Three calls of 64.
  EXPECT_EQ(calls_until_quiet(sender), 3);
  EXPECT_EQ(sender.counters().error_reports, payloads.size());
  EXPECT_EQ(sender.counters().receive_errors, 0u);
}

TEST(UdpTransport, ReportsOfTheNetworkDoNotKeepTheHandleReadable) {
  UdpTransport sender(on_lo());
  const int on = 1;
  ASSERT_EQ(::setsockopt(sender.native_handle(), IPPROTO_IP, IP_RECVERR, &on, sizeof on), 0);
  const Address nobody = UdpTransport(on_lo()).local_address();
  ASSERT_EQ(sender.send(to_all(nobody, {payload(0, 100)})).taken, 1u);
  ASSERT_TRUE(wait_for(sender, POLLERR));
  EXPECT_LE(calls_until_quiet(sender), 2);
  EXPECT_EQ(sender.counters().error_reports, 1u);
  // It still sends and receives.
  UdpTransport receiver(on_lo());
  expect_round_trip(sender, receiver, {payload(0, 100), payload(1, 300)});
}

TEST(UdpTransport, TellsWhenTheKernelReceived) {
  UdpTransport sender(on_lo());
  UdpTransport receiver(on_lo());
  const std::vector<Bytes> payloads{payload(0, 100), payload(1, 200)};
  // Both clocks are read one after the other.
  const Duration slack = std::chrono::milliseconds(1);
  const TimePoint before = now() - slack;
  ASSERT_EQ(sender.send(to_all(receiver.local_address(), payloads)).taken, 2u);
  for (std::size_t count = 0; count < 2;) {
    ASSERT_TRUE(wait_for(receiver, POLLIN));
    const auto batch = receiver.receive();
    const TimePoint after = now() + slack;
    for (const Incoming& datagram : batch) {
      EXPECT_GE(datagram.at, before);
      EXPECT_LE(datagram.at, after);
    }
    count += batch.size();
  }
}

TEST(UdpTransport, MixedSizesAndTwoReceivers) {
  UdpTransport sender(on_lo());
  UdpTransport first(on_lo());
  UdpTransport second(on_lo());
  const std::vector<std::size_t> sizes = {1400, 1400, 1400, 9, 1400, 800,
                                          800,  1,    1,    1, 1400, 65507};
  std::vector<Bytes> payloads;
  std::vector<Outgoing> batch;
  std::vector<Bytes> expected[2];
  for (std::size_t i = 0; i < 40 * sizes.size(); ++i) {
    payloads.push_back(payload(i, i < 3 * sizes.size() ? sizes[i % sizes.size()] : 3 + i % 5));
  }
  for (std::size_t i = 0; i < payloads.size(); ++i) {
    const std::size_t to = (i / 7) % 2;
    batch.push_back({to == 0 ? first.local_address() : second.local_address(), payloads[i]});
    expected[to].push_back(payloads[i]);
  }
  ASSERT_EQ(sender.send(batch).taken, batch.size());
  EXPECT_EQ(receive_all(first, expected[0].size()), expected[0]);
  EXPECT_EQ(receive_all(second, expected[1].size()), expected[1]);
  EXPECT_EQ(sender.counters().send_errors, 0u);
}

TEST(UdpTransport, PartsArriveAsOneDatagram) {
  UdpTransport sender(on_lo());
  UdpTransport receiver(on_lo());
  // More than fit into one call, some of them of another size, some without one of the parts.
  std::vector<Bytes> whole;
  for (std::size_t i = 0; i < 1500; ++i) whole.push_back(payload(i, i % 100 == 99 ? 60 : 300));
  std::vector<Outgoing> batch;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const ByteView bytes(whole[i]);
    const std::size_t head = i % 3 == 0 ? 1 : 37;
    const std::size_t tail = i % 5 == 0 ? 0 : 16;
    batch.push_back({.to = receiver.local_address(),
                     .head = bytes.first(head),
                     .payload = bytes.subspan(head, bytes.size() - head - tail),
                     .tail = bytes.last(tail)});
  }
  EXPECT_EQ(batch[7].joined(), whole[7]);
  std::vector<Bytes> got;
  for (std::size_t sent = 0; sent < batch.size();) {
    const std::size_t some = std::min<std::size_t>(500, batch.size() - sent);
    ASSERT_EQ(sender.send(std::span(batch).subspan(sent, some)).taken, some);
    for (Bytes& bytes : receive_all(receiver, some)) got.push_back(std::move(bytes));
    sent += some;
  }
  EXPECT_EQ(got, whole);
  EXPECT_EQ(sender.counters().send_errors, 0U);
}

TEST(UdpTransport, EcnBitsTravelWithTheirDatagrams) {
  for (const char* host : {"127.0.0.1", "::1"}) {
    std::unique_ptr<UdpTransport> sender;
    std::unique_ptr<UdpTransport> receiver;
    try {
      sender = std::make_unique<UdpTransport>(on_lo(host));
      receiver = std::make_unique<UdpTransport>(on_lo(host));
    } catch (const IoError& error) {
      GTEST_SKIP() << error.what();
    }
    // Runs of equal ones, which leave as one segmented send each.
    std::vector<Bytes> payloads;
    std::vector<Outgoing> batch;
    for (std::size_t i = 0; i < 40; ++i) payloads.push_back(payload(i, 200));
    for (std::size_t i = 0; i < payloads.size(); ++i) {
      batch.push_back({.to = receiver->local_address(),
                       .head = payloads[i],
                       .ecn = static_cast<std::uint8_t>(i / 10)});
    }
    ASSERT_EQ(sender->send(batch).taken, batch.size());
    std::size_t count = 0;
    while (count < batch.size() && wait_for(*receiver, POLLIN)) {
      for (const Incoming& datagram : receiver->receive()) {
        EXPECT_EQ(datagram.ecn, batch[count].ecn) << host << " " << count;
        ++count;
      }
    }
    EXPECT_EQ(count, batch.size()) << host;
  }
}

TEST(UdpTransport, FromIsWhereAnAnswerGoes) {
  UdpTransport a(on_lo());
  UdpTransport b(on_lo("127.0.0.2"));
  const Bytes bytes = payload(1, 50);
  a.send(to_all(b.local_address(), {bytes}));
  ASSERT_TRUE(wait_for(b, POLLIN));
  const auto got = b.receive();
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0].from, a.local_address());
}

TEST(UdpTransport, Ipv6) {
  if (!parse_address("[::1]:0")) GTEST_SKIP();
  std::unique_ptr<UdpTransport> sender;
  try {
    sender = std::make_unique<UdpTransport>(on_lo("::1"));
  } catch (const IoError& error) {
    GTEST_SKIP() << error.what();
  }
  UdpTransport receiver(on_lo("::1"));
  std::vector<Bytes> payloads;
  for (std::size_t i = 0; i < 100; ++i) payloads.push_back(payload(i, 1300));
  expect_round_trip(*sender, receiver, payloads);
}

TEST(UdpTransport, WhatTheKernelDoesNotSegmentIsSentOneByOne) {
  UdpTransport sender(on_lo());
  UdpTransport receiver(on_lo());
  const int on = 1;  // without checksums the kernel refuses UDP_SEGMENT
  ASSERT_EQ(::setsockopt(sender.native_handle(), SOL_SOCKET, SO_NO_CHECK, &on, sizeof on), 0);
  for (int turn = 0; turn < 12; ++turn) {
    std::vector<Bytes> payloads;
    for (std::size_t i = 0; i < 90; ++i) payloads.push_back(payload(i, i == 63 ? 500 : 900));
    expect_round_trip(sender, receiver, payloads);
  }
  EXPECT_GE(sender.counters().offload_refused, 1u);
  EXPECT_FALSE(sender.capabilities().segmentation_offload);  // it has learnt
  EXPECT_EQ(sender.counters().send_errors, 0u);
}

TEST(UdpTransport, AnOversizeDatagramIsDroppedAndCountedAloneAmongOthers) {
  UdpTransport sender(on_lo());
  UdpTransport receiver(on_lo());
  const std::vector<Bytes> payloads = {payload(0, 100), payload(1, 65508), payload(2, 100)};
  ASSERT_EQ(sender.send(to_all(receiver.local_address(), payloads)).taken, 3u);
  EXPECT_EQ(receive_all(receiver, 2), (std::vector<Bytes>{payloads[0], payloads[2]}));
  EXPECT_EQ(sender.counters().send_errors, 1u);
  EXPECT_EQ(sender.counters().last_send_error, EMSGSIZE);
}

TEST(UdpTransport, AnAddressOfAnotherKindIsDroppedAndCounted) {
  UdpTransport sender(on_lo());
  const Bytes bytes = payload(0, 100);
  EXPECT_EQ(sender.send(to_all(*parse_address("[::1]:9"), {bytes, bytes})).taken, 2u);
  EXPECT_EQ(sender.send(to_all(Address{}, {bytes})).taken, 1u);
  EXPECT_EQ(sender.counters().send_errors, 3u);
  EXPECT_EQ(sender.counters().sent_datagrams, 0u);
}

TEST(UdpTransport, NobodyListeningIsNoError) {
  UdpTransport sender(on_lo());
  Address nobody;
  {
    UdpTransport gone(on_lo());
    nobody = gone.local_address();
  }
  const Bytes bytes = payload(0, 100);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(sender.send(to_all(nobody, {bytes})).taken, 1u);
  EXPECT_TRUE(sender.receive().empty());
}

TEST(UdpTransport, TheKernelsDropsAreCounted) {
  UdpTransport sender(on_lo());
  UdpOptions small = on_lo();
  small.receive_buffer_bytes = 16 * 1024;
  UdpTransport receiver(small);
  const std::size_t count = 200;
  for (std::size_t i = 0; i < count; ++i) {
    const Bytes bytes = payload(i, 1200);
    ASSERT_EQ(sender.send(to_all(receiver.local_address(), {bytes})).taken, 1u);
  }
  std::size_t got = 0;
  while (wait_for(receiver, POLLIN)) {
    for (auto batch = receiver.receive(); !batch.empty(); batch = receiver.receive()) {
      for (const Incoming& datagram : batch) {
        ++got;
        if (datagram.bytes.size() != 7) continue;
        // The last: it carries the count of drops before it.
        EXPECT_EQ(got + receiver.counters().receive_queue_drops, count + 1);
        EXPECT_GT(receiver.counters().receive_queue_drops, 0u);
        return;
      }
    }
    if (got < count) {
      const Bytes last = payload(0, 7);
      ASSERT_EQ(sender.send(to_all(receiver.local_address(), {last})).taken, 1u);
    }
  }
  FAIL() << "the last datagram never came";
}

TEST(UdpTransport, AnUnknownNicIsNamedWithThoseThatExist) {
  UdpOptions options = on_lo();
  options.nic = "nosuch0";
  EXPECT_THAT(error_of(options, ENODEV),
              testing::StartsWith("no network card named nosuch0; there are "));
  options.nic = "";
  EXPECT_THAT(error_of(options, ENODEV), testing::StartsWith("no network card named \"\""));
  options.nic = "a-name-longer-than-a-card-may-have";
  EXPECT_THAT(error_of(options, ENODEV), testing::HasSubstr("a-name-longer-than-a-card-may-have"));
}

TEST(UdpTransport, ATakenPortIsNamedWithTheRemedy) {
  UdpTransport first(on_lo());
  const std::uint16_t port = port_of(first.local_address());
  ASSERT_NE(port, 0);
  EXPECT_EQ(error_of(on_lo("127.0.0.1", port), EADDRINUSE),
            "port " + std::to_string(port) + " on lo is taken; choose another with --port");
  UdpTransport other_address(on_lo("127.0.0.2", port));  // the same port elsewhere is free
}

TEST(UdpTransport, AnAddressOfAnotherNicIsRefused) {
  EXPECT_THAT(error_of(on_lo("192.0.2.1"), EADDRNOTAVAIL),
              testing::StartsWith("192.0.2.1 is no address of lo; it has 127.0.0.1"));
}

TEST(UdpTransport, BuffersThatCannotBeHadAreReported) {
  UdpOptions options = on_lo();
  UdpTransport normal(options);
  EXPECT_GE(normal.capabilities().send_buffer_bytes, 1u);
  options.receive_buffer_bytes = std::size_t{1} << 31;  // more than the kernel can give anybody
  UdpTransport transport(options);
  ASSERT_FALSE(transport.warnings().empty());
  EXPECT_THAT(transport.warnings().back(), testing::HasSubstr("sysctl -w net.core.rmem_max="));
}

TEST(UdpTransport, NothingStaysOpen) {
  const std::size_t before = open_descriptors();
  for (int i = 0; i < 10; ++i) {
    UdpTransport a(on_lo());
    EXPECT_GT(open_descriptors(), before);
    error_of(on_lo("127.0.0.1", port_of(a.local_address())), EADDRINUSE);
    error_of(on_lo("192.0.2.1"), EADDRNOTAVAIL);
    UdpOptions unknown = on_lo();
    unknown.nic = "nosuch0";
    error_of(unknown, ENODEV);
  }
  EXPECT_EQ(open_descriptors(), before);
}

// Sends to `to` and returns where the answer comes from.
std::string answer_from(UdpTransport& server, const Address& to) {
  UdpTransport client(on_lo(is_ipv6(to) ? "::1" : "127.0.0.1"));
  const Bytes bytes = payload(0, 100);
  client.send(to_all(to, {bytes, bytes}));  // two, so that segmentation has a say
  if (!wait_for(server, POLLIN)) return "nothing came";
  Address from{};
  for (const Incoming& datagram : server.receive()) from = datagram.from;
  EXPECT_EQ(to_string(from), to_string(client.local_address()));
  server.send(to_all(from, {bytes, bytes}));
  if (!wait_for(client, POLLIN)) return "no answer";
  for (const Incoming& datagram : client.receive()) from = datagram.from;
  return to_string(from);
}

TEST(UdpTransport, AnswersLeaveFromTheAddressThatWasAsked) {
  UdpOptions options = on_lo("0.0.0.0");
  options.answer_from_receiver = true;
  UdpTransport server(options);
  const std::uint16_t port = port_of(server.local_address());
  for (const char* host : {"127.0.0.9", "127.0.0.1", "127.3.2.1", "127.0.0.9"}) {
    EXPECT_EQ(answer_from(server, *make_address(host, port)), to_string(*make_address(host, port)));
  }
  // Without it the kernel chooses, which is what the others rely on.
  UdpTransport plain(on_lo("0.0.0.0"));
  const std::uint16_t other = port_of(plain.local_address());
  EXPECT_EQ(answer_from(plain, *make_address("127.0.0.9", other)),
            to_string(*make_address("127.0.0.1", other)));
}

TEST(UdpTransport, MoreAddressesThanCanBeNotedAreAnsweredFromOne) {
  UdpOptions options = on_lo("0.0.0.0");
  options.answer_from_receiver = true;
  UdpTransport server(options);
  const std::uint16_t port = port_of(server.local_address());
  for (int i = 1; i <= 255; ++i) {
    const auto host = *make_address("127.0.7." + std::to_string(i), port);
    ASSERT_EQ(answer_from(server, host), to_string(host));
  }
  EXPECT_EQ(answer_from(server, *make_address("127.0.8.1", port)),
            to_string(*make_address("127.0.0.1", port)));
}

}  // namespace
}  // namespace interneuron::io::udp_transport_test
