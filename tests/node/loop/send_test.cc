// Plain messages between two nodes, on the loopback card and through the other transports.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>
#include <vector>

#include "interneuron/node.h"
#include "node/io/open_transport.h"
#include "tests/node/io/namespace.h"
#include "tests/node/io/two_hosts.h"

namespace interneuron::send_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

NodeOptions options_on_loopback() {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{1}, .nic = "lo", .local_address = "127.0.0.1"}};
  options.accept_peers = true;
  return options;
}

// A road that keeps what comes, and a vehicle that runs in the test's thread.
struct Nodes {
  Node road{options_on_loopback()};
  Node vehicle{vehicle_options()};
  std::vector<Message> came;
  std::vector<MessageFate> fates;
  std::thread loop;

  Nodes() {
    road.on_message([this](Message m) { came.push_back(std::move(m)); });
    vehicle.on_fate([this](MessageFate fate) {
      fates.push_back(fate);
      vehicle.stop();
    });
    vehicle.after(std::chrono::seconds(20), [] { throw std::runtime_error("it took too long"); });
    loop = std::thread([this] { road.run(); });
  }
  ~Nodes() { join(); }
  void join() {
    if (!loop.joinable()) return;
    road.stop();
    loop.join();
  }
  NodeOptions vehicle_options() {
    NodeOptions options = options_on_loopback();
    options.accept_peers = false;
    options.links[0].peer = to_string(*road.local_address(LinkId{1}));
    return options;
  }
};

TEST(NodeSend, AMessageFromAHandlerIsDelivered) {
  Nodes nodes;
  nodes.vehicle.on_peer_ready([&](PeerReady p) {
    const SendResult sent = nodes.vehicle.send(p.peer, Bytes(50'000, std::byte{7}),
                                               {.deadline = milliseconds(2000), .channel = 5});
    EXPECT_TRUE(sent.accepted()) << to_string(sent.status);
  });
  nodes.vehicle.run();
  nodes.join();
  ASSERT_EQ(nodes.fates.size(), 1U);
  EXPECT_EQ(nodes.fates[0].fate, Fate::kDelivered);
  ASSERT_EQ(nodes.came.size(), 1U);
  EXPECT_EQ(nodes.came[0].bytes, Bytes(50'000, std::byte{7}));
  EXPECT_EQ(nodes.came[0].channel, 5);
}

TEST(NodeSend, AnotherThreadPostsAndVariantsAreSentToo) {
  Nodes nodes;
  std::thread other;
  nodes.vehicle.on_peer_ready([&](PeerReady p) {
    other = std::thread([&nodes, peer = p.peer] {
      nodes.vehicle.post([&nodes, peer] {
        const Variants variants{Bytes(20'000), Bytes(100)};
        const SendResult sent =
            nodes.vehicle.send(peer, variants, {.deadline = milliseconds(2000)});
        EXPECT_TRUE(sent.accepted()) << to_string(sent.status);
      });
    });
  });
  nodes.vehicle.run();
  other.join();
  nodes.join();
  ASSERT_EQ(nodes.fates.size(), 1U);
  EXPECT_EQ(nodes.fates[0].fate, Fate::kDelivered);
  EXPECT_EQ(nodes.came.size(), 1U);
}

TEST(NodeSend, WhatIsCancelledIsDropped) {
  Nodes nodes;
  nodes.vehicle.on_peer_ready([&](PeerReady p) {
    const SendResult sent =
        nodes.vehicle.send(p.peer, Bytes(8'000'000), {.deadline = milliseconds(5000)});
    EXPECT_TRUE(sent.accepted()) << to_string(sent.status);
    EXPECT_TRUE(nodes.vehicle.cancel(sent.id));
    EXPECT_FALSE(nodes.vehicle.cancel(sent.id));
  });
  nodes.vehicle.run();
  nodes.join();
  ASSERT_EQ(nodes.fates.size(), 1U);
  EXPECT_EQ(nodes.fates[0].reason, FateReason::kCancelled);
  EXPECT_TRUE(nodes.came.empty());
}

void expect_that_messages_travel_through(TransportKind kind, io::Root root) {
  io::in_namespace(
      [kind] {
        const io::TwoHosts hosts;
        if (!hosts.made()) GTEST_SKIP();
        NodeOptions options;
        options.insecure = true;
        options.links = {{.id = LinkId{0}, .nic = "vb"}};
        options.accept_peers = true;
        options.transport = kind;
        const auto road = hosts.there([&] { return std::make_unique<Node>(options); });
        EXPECT_THAT(road->warnings(), testing::Contains(testing::HasSubstr("bypass nftables")));
        const std::uint16_t port = port_of(*road->local_address(LinkId{0}));
        std::thread loop([&road] { road->run(); });

        options.accept_peers = false;
        options.links = {
            {.id = LinkId{0}, .nic = "va", .peer = "10.99.0.2:" + std::to_string(port)}};
        Node vehicle(options);
        std::optional<Fate> fate;
        vehicle.on_peer_ready([&](PeerReady ready) {
          vehicle.send(ready.peer, Bytes(100'000), {.deadline = seconds(20)});
        });
        vehicle.on_fate([&](const MessageFate& e) {
          fate = e.fate;
          vehicle.stop();
        });
        vehicle.after(seconds(60), [] { throw std::runtime_error("it took too long"); });
        vehicle.run();
        road->stop();
        loop.join();
        EXPECT_EQ(fate, Fate::kDelivered);
        EXPECT_EQ(road->transport_counters(LinkId{0}).receive_errors, 0U);
      },
      root);
}

TEST(Node, MessagesTravelThroughRings) {
  expect_that_messages_travel_through(TransportKind::kRing, io::Root::kOfNamespace);
}

TEST(Node, MessagesTravelThroughXdp) {
  try {
    io::require_privilege(TransportKind::kXdp);
  } catch (const IoError& error) {
    GTEST_SKIP() << error.what();
  }
  expect_that_messages_travel_through(TransportKind::kXdp, io::Root::kOfHost);
}

}  // namespace
}  // namespace interneuron::send_test
