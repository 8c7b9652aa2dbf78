// What a Node tells of its peers and of its own loop.
#include <gtest/gtest.h>

#include <stdexcept>

#include "interneuron/node.h"

namespace interneuron::statistics_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

NodeOptions options_on_loopback() {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{0}, .nic = "lo", .local_address = "127.0.0.1"}};
  options.accept_peers = true;
  return options;
}

TEST(NodeStatistics, TellHowLongWorkKeptTheLoop) {
  Node node(options_on_loopback());
  EXPECT_EQ(node.statistics().loop_stall, Duration{});
  node.after(Duration{}, [&node] {
    const TimePoint end = node.now() + milliseconds(20);
    while (node.now() < end) continue;
    node.after(Duration{}, [&node] { node.stop(); });
  });
  node.run();
  EXPECT_GE(node.statistics().loop_stall, milliseconds(20));
}

TEST(NodeStatistics, HaveALedgerOfEachPeer) {
  NodeOptions options = options_on_loopback();
  // Every complete message but one in a second is too much.
  options.peer_limits.messages_per_second = 1;
  Node road(options);
  std::vector<PeerLimited> limited;
  NodeOptions other = options_on_loopback();
  other.accept_peers = false;
  other.links[0].peer = to_string(*road.local_address(LinkId{0}));
  Node vehicle(other);
  std::thread loop([&road] { road.run(); });
  road.post([&] {
    road.on_peer_limited([&](PeerLimited e) {
      limited.push_back(e);
      vehicle.post([&vehicle] { vehicle.stop(); });
    });
  });
  vehicle.on_peer_ready([&vehicle](PeerReady e) {
    for (int i = 0; i < 10; ++i) vehicle.send(e.peer, Bytes(100), {.deadline = seconds(1)});
  });
  vehicle.after(seconds(60), [] { throw std::runtime_error("the test took too long"); });
  vehicle.run();
  road.stop();
  loop.join();
  ASSERT_FALSE(limited.empty());
  EXPECT_EQ(limited.front().limit, PeerLimit::kMessageRate);
  const Statistics statistics = road.statistics();
  ASSERT_EQ(statistics.peers.size(), 1U);
  EXPECT_EQ(statistics.peers[0].id, limited.front().peer);
  EXPECT_GT(statistics.peers[0].ledger.struck(PeerLimit::kMessageRate), 0U);
}

TEST(NodeStatistics, ARelayIsANumericAddressWithoutPort) {
  for (const char* wrong : {"", "road.example", "10.0.0.2:47000", "0.0.0.0"}) {
    NodeOptions options = options_on_loopback();
    options.relays = {wrong};
    EXPECT_THROW(Node{options}, std::invalid_argument) << wrong;
  }
  NodeOptions options = options_on_loopback();
  options.relays = {"10.0.0.2", "fe80::1%lo", "2001:db8::7"};
  EXPECT_NO_THROW(Node{options});
}

}  // namespace
}  // namespace interneuron::statistics_test
