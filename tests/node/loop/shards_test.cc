// A node of several shards, on the loopback card: its peers are served by several threads, and the
// application sees one node.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/secure/credential.h"
#include "interneuron/node.h"
#include "lab/sim/trust.h"
#include "node/io/socket_group.h"

namespace interneuron::shards_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kPatience{60};  // no test that passes waits for it
constexpr LinkId kLinks[] = {LinkId{0}, LinkId{1}};
constexpr int kRoad = 1;
constexpr int kFirstVehicle = 2;
constexpr int kVehicles = 4;
constexpr std::uint8_t kShards = 2;

NodeOptions on_loopback() {
  NodeOptions options;
  options.links = {{.id = kLinks[0], .nic = "lo", .local_address = "127.0.0.1"},
                   {.id = kLinks[1], .nic = "lo", .local_address = "127.0.0.2"}};
  return options;
}

std::shared_ptr<Security> keys(int host, const std::vector<int>& peers) {
  auto security = std::make_shared<Security>();
  security->key = sim::secret_key(host);
  for (const int peer : peers) security->peers.push_back({sim::key_of_host(peer), {}});
  return security;
}

NodeOptions road_options(bool encrypted, std::uint8_t shards = kShards) {
  NodeOptions options = on_loopback();
  options.accept_peers = true;
  options.shards = shards;
  options.insecure = !encrypted;
  if (!encrypted) return options;
  std::vector<int> vehicles;
  for (int i = 0; i < 2 * kVehicles; ++i) vehicles.push_back(kFirstVehicle + i);
  options.security = keys(kRoad, vehicles);
  return options;
}

// A road on a thread of its own that answers every round and every message. What it notes is its
// thread's until stop().
class Road {
 public:
  explicit Road(NodeOptions options) : node(std::move(options)) {
    node.on_delivered([this](const Delivered& d) {
      threads.insert(std::this_thread::get_id());
      rounds_of[d.from] += 1;
      EXPECT_EQ(node.submit(d.round, {Bytes(d.payload.size() / 2)}, MessageClass::kResult),
                SubmitStatus::kAccepted);
    });
    node.on_message([this](const Message& m) {
      threads.insert(std::this_thread::get_id());
      const SendResult result = node.send(m.peer, Bytes(100), {.deadline = seconds(10)});
      EXPECT_EQ(result.status, SendStatus::kAccepted);
      EXPECT_TRUE(sent.insert(result.id).second);
    });
    node.on_fate([this](const MessageFate& fate) {
      EXPECT_EQ(sent.count(fate.id), 1U);
      if (fate.fate == Fate::kDelivered) ++delivered;
    });
    node.on_peer_ready([this](const PeerReady& e) {
      ready.push_back(e.peer);
      ++peers;
    });
    node.on_peer_lost([this](const PeerLost& e) { lost.push_back(e.peer); });
    node.on_revocations_changed([this](const RevocationsChanged&) { ++lists; });
    thread_ = std::thread([this] {
      loop = std::this_thread::get_id();
      node.run();
    });
  }
  ~Road() { stop(); }
  void stop() {
    node.stop();
    if (thread_.joinable()) thread_.join();
  }
  NodeOptions vehicle(int number, bool encrypted) const {
    NodeOptions options = on_loopback();
    for (NodeLink& link : options.links) link.peer = to_string(*node.local_address(link.id));
    options.insecure = !encrypted;
    if (encrypted) options.security = keys(kFirstVehicle + number, {kRoad});
    PipelineConfig pipeline{.stages = offload_stages()};
    pipeline.deadline = seconds(20);  // long, so that a slow machine with sanitizers stays on time
    options.pipelines = {pipeline};
    return options;
  }

  Node node;
  std::thread::id loop;
  std::set<std::thread::id> threads;
  std::map<PeerId, int> rounds_of;
  std::set<SendId> sent;
  std::vector<PeerId> ready;
  std::vector<PeerId> lost;
  int delivered = 0;
  int lists = 0;
  std::atomic<int> peers{0};

 private:
  std::thread thread_;
};

constexpr int kRounds = 10;

// A vehicle that sends rounds and then messages, one after the other, and ends after the last
// answer. How many were answered.
int drive(NodeOptions options, int messages = kRounds) {
  Node vehicle(std::move(options));
  int answered = 0;
  int left = messages;
  const auto next = [&] {
    vehicle.submit(vehicle.begin_round({}), {Bytes(50'000)}, MessageClass::kData);
  };
  const auto send = [&] {
    // The fate of the road's last message still has to arrive there.
    if (left-- == 0) return vehicle.after(milliseconds(200), [&] { vehicle.stop(); });
    vehicle.send(*vehicle.peer(), Bytes(2'000), {.deadline = seconds(10)});
  };
  vehicle.on_peer_ready([&](PeerReady) { next(); });
  vehicle.on_round_done([&](const RoundDone& done) {
    if (done.outcome == Outcome::kRemote && done.result == Bytes(25'000)) ++answered;
    if (answered == kRounds) return send();
    next();
  });
  vehicle.on_message([&](const Message&) {
    ++answered;
    send();
  });
  vehicle.after(kPatience, [] { throw std::runtime_error("the test took too long"); });
  vehicle.run();
  std::size_t up = 0;
  for (const LinkState& link : vehicle.links(*vehicle.peer())) up += link.up ? 1 : 0;
  EXPECT_EQ(up, std::size(kLinks));
  return answered;
}

void serve_all(Road& road, bool encrypted) {
  std::vector<std::thread> threads;
  std::atomic<int> answered{0};
  for (int i = 0; i < kVehicles; ++i) {
    threads.emplace_back([&, i] { answered += drive(road.vehicle(i, encrypted)); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(answered, 2 * kRounds * kVehicles);
}

std::map<std::uint8_t, int> peers_of_shards(const std::vector<PeerId>& peers) {
  std::map<std::uint8_t, int> out;
  for (const PeerId peer : peers) ++out[shard_of(peer, kShards)];
  return out;
}

TEST(Shards, ServePeersOverTwoLinksEncrypted) {
  Road road(road_options(true));
  serve_all(road, true);
  road.stop();
  const Statistics all = road.node.statistics();
  EXPECT_THAT(road.threads, testing::ElementsAre(road.loop));
  EXPECT_THAT(road.rounds_of, testing::SizeIs(kVehicles));
  for (const auto& [peer, rounds] : road.rounds_of) EXPECT_EQ(rounds, kRounds);
  EXPECT_EQ(road.delivered, kRounds * kVehicles);
  // Keys have shards in turns.
  EXPECT_THAT(peers_of_shards(road.ready), testing::ElementsAre(testing::Pair(1, kVehicles / 2),
                                                                testing::Pair(2, kVehicles / 2)));
  EXPECT_THAT(all.peers, testing::SizeIs(kVehicles));
  for (const Statistics::Peer& peer : all.peers) EXPECT_THAT(peer.links, testing::SizeIs(2));
  std::uint64_t datagrams = 0;
  for (const Statistics::Link& link : all.links) {
    EXPECT_EQ(link.counters.unauthentic_packets, 0U);
    EXPECT_GE(link.counters.handshake_packets, 1U);
    // Each datagram is counted once, whichever sockets it has passed.
    const LinkCounters& c = link.counters;
    EXPECT_EQ(link.transport.received_datagrams,
              c.received_packets + c.duplicate_packets + c.refused_packets + c.handshake_packets);
    datagrams += link.transport.received_datagrams;
  }
  EXPECT_GT(datagrams, 100U);
  EXPECT_EQ(all.counters.messages_completed, 2U * kRounds * kVehicles);
}

TEST(Shards, ServePeersInTheClear) {
  Road road(road_options(false));
  serve_all(road, false);
  road.stop();
  EXPECT_THAT(road.threads, testing::ElementsAre(road.loop));
  EXPECT_THAT(road.rounds_of, testing::SizeIs(kVehicles));
  EXPECT_EQ(road.delivered, kRounds * kVehicles);
}

// Sockets that stand for each other in a circle: whatever comes is for somebody else.
class Crossed final : public Transport {
 public:
  using Circle = std::vector<std::unique_ptr<Transport>>;
  Crossed(std::shared_ptr<Circle> circle, std::size_t place)
      : circle_(std::move(circle)), place_(place) {}
  BatchResult send(std::span<const Outgoing> batch) override { return next().send(batch); }
  std::span<const Incoming> receive() override { return next().receive(); }
  TransportCaps capabilities() const override { return next().capabilities(); }
  TransportCounters counters() const override { return next().counters(); }
  Address local_address() const override { return next().local_address(); }
  int native_handle() const override { return next().native_handle(); }

 private:
  Transport& next() const { return *(*circle_)[(place_ + 1) % circle_->size()]; }
  std::shared_ptr<Circle> circle_;
  std::size_t place_;
};

TEST(Shards, WhatComesToTheWrongOneIsHandedOn) {
  for (const bool encrypted : {false, true}) {
    NodeOptions options = road_options(encrypted);
    auto circles = std::make_shared<std::map<LinkId, std::shared_ptr<Crossed::Circle>>>();
    options.wrap_transport = [circles](LinkId link, std::unique_ptr<Transport> inner) {
      auto& circle = (*circles)[link];
      if (!circle) circle = std::make_shared<Crossed::Circle>();
      circle->push_back(std::move(inner));
      return std::make_unique<Crossed>(circle, circle->size() - 1);
    };
    Road road(std::move(options));
    serve_all(road, encrypted);
    road.stop();
    EXPECT_THAT(road.rounds_of, testing::SizeIs(kVehicles));
  }
}

// A vehicle that begins a new life takes its own place, in the shard where it was.
TEST(Shards, AHostKeepsItsShard) {
  Road road(road_options(true));
  for (int life = 0; life < 3; ++life) {
    EXPECT_EQ(drive(road.vehicle(0, true), 1), kRounds + 1);
    EXPECT_EQ(drive(road.vehicle(1, true), 1), kRounds + 1);
  }
  road.stop();
  EXPECT_THAT(road.node.peers(), testing::SizeIs(2));
  ASSERT_THAT(road.ready, testing::SizeIs(6));
  EXPECT_THAT(road.lost, testing::SizeIs(4));
  EXPECT_NE(shard_of(road.ready[0], kShards), shard_of(road.ready[1], kShards));
  for (std::size_t i = 2; i < road.ready.size(); ++i) {
    EXPECT_EQ(shard_of(road.ready[i], kShards), shard_of(road.ready[i - 2], kShards));
  }
}

// One vehicle brings a list that names another, of another shard.
TEST(Shards, RevocationsReachAll) {
  const SecretKey authority = sim::secret_key(77);
  const std::vector<PublicKey> authorities{crypto::authority_key_of(authority)};
  NodeOptions options = road_options(true);
  auto trusted = std::make_shared<Security>(*options.security);
  trusted->authorities = authorities;
  options.security = trusted;
  Road road(std::move(options));
  std::atomic<bool> over{false};
  std::thread revoked([&] {
    Node vehicle(road.vehicle(0, true));
    const std::function<void()> look = [&] {
      if (over) return vehicle.stop();
      vehicle.after(milliseconds(10), look);
    };
    look();
    vehicle.run();
  });
  while (road.peers == 0) std::this_thread::sleep_for(milliseconds(1));
  NodeOptions bringer = road.vehicle(1, true);
  auto knows = std::make_shared<Security>(*bringer.security);
  knows->authorities = authorities;
  knows->revocations =
      crypto::sign_revocations({1'000, {sim::key_of_host(kFirstVehicle)}}, authority);
  bringer.security = knows;
  EXPECT_EQ(drive(std::move(bringer)), 2 * kRounds);
  over = true;
  revoked.join();
  road.stop();
  EXPECT_EQ(road.lists, 1);
  ASSERT_FALSE(road.ready.empty());
  EXPECT_THAT(road.lost, testing::ElementsAre(road.ready.front()));
  EXPECT_THAT(road.ready, testing::SizeIs(2));
}

TEST(Shards, PlacesAreForAllTogether) {
  NodeOptions options = road_options(true);
  options.max_peers = 1;
  Road road(std::move(options));
  EXPECT_EQ(drive(road.vehicle(0, true), 1), kRounds + 1);
  Node second(road.vehicle(1, true));
  bool is_ready = false;
  second.on_peer_ready([&](PeerReady) { is_ready = true; });
  second.after(seconds(1), [&] { second.stop(); });
  second.run();
  EXPECT_FALSE(is_ready);
  road.stop();
  EXPECT_THAT(road.node.peers(), testing::SizeIs(1));
}

TEST(Shards, APortThatIsTakenIsRefused) {
  for (const std::uint8_t first : {std::uint8_t{1}, kShards}) {
    const Node road(road_options(false, first));
    NodeOptions second = road_options(false);
    second.port = port_of(*road.local_address(kLinks[0]));
    second.links.resize(1);
    try {
      const Node taken(second);
      ADD_FAILURE() << "two nodes have one port";
    } catch (const IoError& error) {
      EXPECT_EQ(error.code(), EADDRINUSE);
    }
  }
}

TEST(Shards, WhatOneNodeCannotDoIsRefusedInWords) {
  const auto refused = [](auto change) {
    NodeOptions options = road_options(false);
    change(options);
    try {
      const Node node(options);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refused([](NodeOptions&) {}), "");
  EXPECT_THAT(refused([](auto& o) { o.shards = 0; }), testing::HasSubstr("it must be 1 to 64"));
  EXPECT_THAT(refused([](auto& o) { o.shards = 65; }), testing::HasSubstr("it must be 1 to 64"));
  EXPECT_THAT(refused([](auto& o) { o.accept_peers = false; }), testing::HasSubstr("connected to"));
  EXPECT_THAT(refused([](auto& o) { o.links[0].peer = "127.0.0.1:47000"; }),
              testing::HasSubstr("connects to none"));
  EXPECT_THAT(refused([](auto& o) { o.transport = TransportKind::kRing; }),
              testing::HasSubstr("UDP"));
  EXPECT_THAT(refused([](auto& o) { o.pipelines.push_back({.stages = offload_stages()}); }),
              testing::HasSubstr("no rounds"));
  EXPECT_THAT(refused([](auto& o) { o.relays = {"127.0.0.1"}; }), testing::HasSubstr("relays"));
}

TEST(Shards, AnyBytesHaveOne) {
  EXPECT_EQ(io::shard_of_packet({}, 2, true), 0);
  EXPECT_EQ(io::shard_of_packet(Bytes(7), 2, true), 0);
  Bytes packet(36);
  packet[0] = std::byte{0x35};
  for (unsigned last = 0; last < 256; ++last) {
    packet[7] = static_cast<std::byte>(last);
    packet[1] = std::byte{0};
    EXPECT_EQ(io::shard_of_packet(packet, 3, true), 0);
    EXPECT_EQ(io::shard_of_packet(packet, 3, false), last % 3 + 1);
    packet[1] = std::byte{1};
    EXPECT_EQ(io::shard_of_packet(packet, 3, true), last % 3 + 1);
  }
}

}  // namespace
}  // namespace interneuron::shards_test
