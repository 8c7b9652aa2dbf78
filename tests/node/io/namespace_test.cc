// What only a NIC of one's own shows: a full send buffer, a small MTU, a card that vanishes.
#include "namespace.h"

#include "node/io/udp_socket.h"
#include "support.h"

namespace interneuron::io::namespace_test {
namespace {

UdpOptions on_va() { return UdpOptions{.nic = "va", .local = *make_address("10.99.0.1", 0)}; }

const Address kPeer = *parse_address("10.99.0.2:9");

TEST(Namespace, AFullSendBufferIsReportedAndNothingIsLost) {
  in_namespace([] {
    if (!shell("tc qdisc add dev va root tbf rate 80mbit burst 20kb limit 10mb")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    UdpOptions options = on_va();
    options.send_buffer_bytes = 64 * 1024;
    UdpTransport sender(options);
    std::vector<Bytes> payloads;
    for (std::size_t i = 0; i < 600; ++i) payloads.push_back(payload(i, 1200));
    const auto batch = to_all(kPeer, payloads);
    std::size_t done = 0;
    std::size_t blocked = 0;
    while (done < batch.size()) {
      const BatchResult result = sender.send(std::span(batch).subspan(done));
      done += result.taken;
      blocked += result.would_block ? 1 : 0;
      if (result.would_block && !wait_for(sender, POLLOUT)) FAIL() << "writable again";
    }
    EXPECT_GT(blocked, 0) << "the buffer was full at least once";
    EXPECT_EQ(sender.counters().sent_datagrams, 600) << "all are sent";
    EXPECT_EQ(sender.counters().send_errors, 0) << "no errors";
  });
}

TEST(Namespace, LargerThanTheMtuIsRefusedNotFragmented) {
  in_namespace([] {
    UdpTransport sender(on_va());
    const Bytes fits = payload(0, 1472);
    const Bytes exceeds = payload(1, 1473);
    sender.send(to_all(kPeer, {fits, fits, fits}));
    const bool clean = sender.counters().send_errors == 0;
    sender.send(to_all(kPeer, {exceeds, exceeds, fits, fits}));
    EXPECT_TRUE(clean) << "1472 bytes fit into 1500";
    EXPECT_EQ(sender.counters().send_errors, 2) << "1473 bytes do not";
    EXPECT_EQ(sender.counters().last_send_error, EMSGSIZE) << "EMSGSIZE";
    EXPECT_EQ(sender.counters().sent_datagrams, 5) << "the others are sent";
  });
}

TEST(Namespace, ACardThatIsDownCountsErrorsAndWorksWhenItIsBack) {
  in_namespace([] {
    UdpTransport sender(on_va());
    const Bytes bytes = payload(0, 100);
    if (!shell("ip link set va down")) GTEST_SKIP() << "this kernel lacks what the test needs";
    const BatchResult down = sender.send(to_all(kPeer, {bytes, bytes}));
    shell("ip link set va up");
    shell("ip neigh replace 10.99.0.2 lladdr 02:00:00:00:00:02 dev va");
    const BatchResult up = sender.send(to_all(kPeer, {bytes}));
    EXPECT_EQ(down.taken, 2) << "down is not gone";
    EXPECT_EQ(down.gone, 0) << "down is not gone";
    EXPECT_EQ(sender.counters().send_errors, 2) << "two errors";
    EXPECT_EQ(up.taken, 1) << "sent when up again";
    EXPECT_EQ(sender.counters().sent_datagrams, 1) << "sent when up again";
  });
}

TEST(Namespace, ACardThatVanishesIsGone) {
  in_namespace([] {
    UdpTransport sender(on_va());
    const Bytes bytes = payload(0, 100);
    sender.send(to_all(kPeer, {bytes}));
    if (!shell("ip link del va")) GTEST_SKIP() << "this kernel lacks what the test needs";
    const BatchResult result = sender.send(to_all(kPeer, {bytes, bytes, bytes}));
    sender.receive();
    EXPECT_EQ(result.gone, ENODEV) << "gone";
    EXPECT_EQ(result.taken, 3) << "all are dropped";
    EXPECT_EQ(sender.counters().send_errors, 3) << "and counted";
  });
}

TEST(Namespace, OnlyTheBoundCardsTrafficArrives) {
  in_namespace([] {
    UdpOptions options = on_va();
    options.local = *make_address("0.0.0.0", 47000);
    UdpTransport bound(options);
    options.nic = "lo";
    UdpTransport same_port(options);  // another card, the same port
    options.local = *make_address("0.0.0.0", 0);
    UdpTransport sender(options);
    const Bytes bytes = payload(0, 100);
    sender.send(to_all(*parse_address("127.0.0.1:47000"), {bytes}));
    EXPECT_EQ(receive_all(same_port, 1).size(), 1) << "it came to the socket on lo";
    EXPECT_TRUE(bound.receive().empty()) << "not to the one on va";
  });
}

TEST(Namespace, Ipv6AnswersLeaveFromTheAddressThatWasAsked) {
  in_namespace([] {
    if (!shell("ip -6 addr add fd00::5/128 dev lo nodad") ||
        !shell("ip -6 addr add fd00::6/128 dev lo nodad")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    UdpOptions options{.nic = "lo", .local = *make_address("::", 0), .answer_from_receiver = true};
    UdpTransport server(options);
    options.answer_from_receiver = false;
    UdpTransport client(options);
    const Bytes bytes = payload(0, 100);
    const auto readable = [](const UdpTransport& transport, int milliseconds) {
      pollfd item{.fd = transport.native_handle(), .events = POLLIN, .revents = 0};
      return ::poll(&item, 1, milliseconds) == 1;
    };
    for (const char* host : {"fd00::6", "fd00::5"}) {
      // The kernel makes the route to an address that was just added in the background.
      const std::vector<Bytes> questions{bytes};
      const auto question = to_all(*make_address(host, port_of(server.local_address())), questions);
      const auto end = std::chrono::steady_clock::now() + kPatience;
      do {
        client.send(question);
      } while (!readable(server, 50) && std::chrono::steady_clock::now() < end);
      ASSERT_TRUE(readable(server, 0)) << "it came";
      server.send(to_all(server.receive().front().from, {bytes}));
      ASSERT_TRUE(wait_for(client, POLLIN)) << "it was answered";
      const std::string from = to_string(client.receive().front().from);
      EXPECT_TRUE(from.starts_with("[" + std::string(host) + "]")) << from;
    }
  });
}

}  // namespace
}  // namespace interneuron::io::namespace_test
