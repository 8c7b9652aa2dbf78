// Two nodes in one process, each with its own loop thread, over two sockets each on the loopback
// card.
#include "interneuron/node.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <latch>
#include <random>
#include <stdexcept>
#include <thread>

#include "node/io/udp_socket.h"
#include "tests/node/io/namespace.h"

namespace interneuron::node_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kPatience{60};  // no test that passes waits for it

Bytes text(std::string_view s) {
  const auto view = std::as_bytes(std::span(s));
  return {view.begin(), view.end()};
}

NodeOptions road_options() {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{0}, .nic = "lo", .local_address = "127.0.0.1"},
                   {.id = LinkId{1}, .nic = "lo", .local_address = "127.0.0.2"}};
  options.accept_peers = true;
  return options;
}

NodeOptions vehicle_options(const Node& road) {
  NodeOptions options = road_options();
  options.accept_peers = false;
  for (NodeLink& link : options.links) link.peer = to_string(*road.local_address(link.id));
  PipelineConfig pipeline{.stages = offload_stages()};
  pipeline.deadline = seconds(20);  // long, so that a slow machine with sanitizers stays on time
  pipeline.period = milliseconds(10);
  options.pipelines = {pipeline};
  return options;
}

// A node whose loop runs on a thread of its own until the end of the scope.
class Running {
 public:
  explicit Running(Node& node) : node_(node), thread_([&node] { node.run(); }) {}
  ~Running() {
    node_.stop();
    thread_.join();
  }

 private:
  Node& node_;
  std::thread thread_;
};

// Ends a test that hangs.
void limit(Node& node) {
  node.after(kPatience, [] { throw std::runtime_error("the test took too long"); });
}

TEST(Node, EveryRoundIsAnsweredRemotelyAcrossWorkersOfTheRoad) {
  constexpr std::uint32_t kRounds = 50;
  Node road(road_options());
  road.on_delivered([&](Delivered message) {
    road.compute(Queue::kComputation, [&road, message = std::move(message)] {
      Bytes result = text("seen ");
      result.insert(result.end(), message.payload.begin(), message.payload.begin() + 8);
      return [&road, round = message.round, result = std::move(result)] {
        road.submit(round, {result}, MessageClass::kResult);
      };
    });
  });
  Node vehicle(vehicle_options(road));
  Running running(road);

  std::uint32_t begun = 0;
  std::vector<RoundDone> answers;
  std::function<void()> next = [&] {
    const RoundRef round = vehicle.begin_round(PipelineId{0});
    EXPECT_EQ(round.round.value, begun);
    Bytes frame(100'000);
    std::copy_n(text("frame no").begin(), 8, frame.begin());
    EXPECT_EQ(vehicle.submit(round, {frame, text("frame no, small")}, MessageClass::kData),
              SubmitStatus::kAccepted);
    if (++begun < kRounds) vehicle.after(milliseconds(10), next);
  };
  vehicle.on_peer_ready([&](PeerReady ready) {
    EXPECT_EQ(ready.peer, *vehicle.peer());
    next();
  });
  vehicle.on_round_done([&](RoundDone done) {
    answers.push_back(std::move(done));
    if (answers.size() == kRounds) vehicle.stop();
  });
  limit(vehicle);
  vehicle.run();

  ASSERT_EQ(answers.size(), kRounds);
  for (const RoundDone& done : answers) {
    EXPECT_EQ(done.outcome, Outcome::kRemote);
    EXPECT_EQ(done.result, text("seen frame no"));
  }
  EXPECT_EQ(vehicle.peers().size(), 1u);
  std::uint64_t sent = 0;
  for (const LinkId link : {LinkId{0}, LinkId{1}}) {
    sent += vehicle.link_counters(link).sent_packets;
    EXPECT_EQ(vehicle.link_counters(link).malformed_packets, 0u);
  }
  EXPECT_GE(sent, kRounds);
  // The kernel carries the ECN bits of segmented sends and shows them again.
  const auto states = vehicle.links(*vehicle.peer());
  EXPECT_TRUE(
      std::ranges::any_of(states, [](const LinkState& s) { return s.ecn == EcnState::kWorks; }));
  EXPECT_TRUE(std::ranges::none_of(
      states, [](const LinkState& s) { return s.ecn == EcnState::kBleached; }));
  EXPECT_EQ(vehicle.stalled_datagrams(LinkId{0}), 0u);
}

TEST(Node, ALocalBackupDoesNotWaitBehindAComputation) {
  Node road(road_options());  // hears nothing: it never runs
  NodeOptions options = vehicle_options(road);
  options.pipelines[0].deadline = milliseconds(300);
  Node vehicle(options);
  std::latch release(1);
  vehicle.compute(Queue::kComputation, [&]() -> Node::Task {
    release.wait();
    return {};
  });
  std::optional<RoundDone> answer;
  vehicle.on_round_done([&](RoundDone done) {
    answer = std::move(done);
    vehicle.stop();
  });
  const RoundRef round = vehicle.begin_round(PipelineId{0});
  vehicle.submit(round, {text("frame")}, MessageClass::kData);
  vehicle.compute(Queue::kLocalBackup, [&vehicle, &release, round] {
    return [&vehicle, &release, round] {
      vehicle.local_result(round, text("local"));
      release.count_down();
    };
  });
  limit(vehicle);
  vehicle.run();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->outcome, Outcome::kLocal);
  EXPECT_EQ(answer->result, text("local"));
  EXPECT_EQ(answer->age_rounds, 0u);
  EXPECT_GE(answer->e2e, milliseconds(300));
}

TEST(Node, StopFromAnotherThread) {
  Node node(road_options());
  std::latch inside(1);
  node.post([&] { inside.count_down(); });
  std::thread stopper([&] {
    inside.wait();
    node.stop();
  });
  node.run();
  stopper.join();
}

TEST(Node, StopBeforeRun) {
  Node node(road_options());
  node.stop();
  node.run();
  EXPECT_THROW(node.run(), std::logic_error);
}

TEST(Node, ASignalStopsIt) {
  Node node(road_options());
  node.stop_on_signals();
  node.after(milliseconds(1), [] { std::raise(SIGTERM); });
  limit(node);
  node.run();
  EXPECT_EQ(node.stopped_by_signal(), SIGTERM);
}

TEST(Node, TasksRunInTheOrderOfTheirTimesAndNeverEarly) {
  Node node(road_options());
  std::vector<int> order;
  const TimePoint start = node.now();
  const auto expect_not_before = [&](int ms) {
    EXPECT_GE(node.now(), start + milliseconds(ms));
    order.push_back(ms);
  };
  node.at(start + milliseconds(30), [&] {
    expect_not_before(30);
    node.stop();
  });
  node.at(start + milliseconds(10), [&] { expect_not_before(10); });
  node.at(start - seconds(5), [&] { expect_not_before(0); });
  node.at(TimePoint::max(), [] { FAIL(); });  // never; destroyed with the node
  node.after(Duration::max(), [] { FAIL(); });
  node.run();
  EXPECT_EQ(order, (std::vector{0, 10, 30}));
}

TEST(Node, WhatATaskThrowsComesOutOfRun) {
  Node node(road_options());
  node.after(milliseconds(1), [] { throw std::runtime_error("from a timer"); });
  EXPECT_THROW(node.run(), std::runtime_error);
}

TEST(Node, WhatAJobThrowsComesOutOfRun) {
  Node node(road_options());
  node.compute(Queue::kComputation, []() -> Node::Task { throw std::runtime_error("from a job"); });
  limit(node);
  EXPECT_THAT([&] { node.run(); },
              testing::ThrowsMessage<std::runtime_error>(testing::StrEq("from a job")));
}

TEST(Node, WhatAHandlerThrowsComesOutOfRun) {
  Node road(road_options());
  Running running(road);
  Node vehicle(vehicle_options(road));
  vehicle.on_peer_ready([](PeerReady) { throw std::runtime_error("from a handler"); });
  limit(vehicle);
  EXPECT_THAT([&] { vehicle.run(); },
              testing::ThrowsMessage<std::runtime_error>(testing::StrEq("from a handler")));
}

TEST(Node, DestroyedWhileJobsRunAndWait) {
  std::atomic<int> ran{0};
  std::latch started(2);
  {
    Node node(road_options());
    for (const Queue queue : {Queue::kComputation, Queue::kLocalBackup}) {
      node.compute(queue, [&] {
        started.count_down();
        ++ran;
        return [&ran] { ran = 1000; };  // never runs: the loop does not
      });
      for (int i = 0; i < 50; ++i) node.compute(queue, [] { return Node::Task{}; });
    }
    started.wait();
  }
  EXPECT_EQ(ran, 2);
}

TEST(Node, PostedFromManyThreads) {
  Node node(road_options());
  int count = 0;  // only the loop thread touches it
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 250; ++i) {
        node.post([&] {
          if (++count == 1000) node.stop();
        });
      }
    });
  }
  limit(node);
  node.run();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(count, 1000);
}

TEST(Node, GarbageIsCountedAndDropped) {
  constexpr std::uint64_t kGarbage = 100;  // fits into any receive buffer
  Node road(road_options());
  const Address to = *road.local_address(LinkId{0});
  std::optional<Running> running(std::in_place, road);

  std::mt19937 random(1);
  io::UdpTransport stranger({.nic = "lo", .local = *make_address("127.0.0.1", 0)});
  for (std::uint64_t i = 0; i < kGarbage; ++i) {
    Bytes bytes(1 + random() % 1400);
    for (std::byte& b : bytes) b = static_cast<std::byte>(random());
    const Outgoing datagram{to, bytes};
    ASSERT_EQ(stranger.send({&datagram, 1}).taken, 1u);
  }
  Node vehicle(vehicle_options(road));
  vehicle.on_peer_ready([&](PeerReady) { vehicle.stop(); });
  limit(vehicle);
  vehicle.run();
  running.reset();

  const LinkCounters counters = road.link_counters(LinkId{0});
  const TransportCounters transport = road.transport_counters(LinkId{0});
  EXPECT_EQ(counters.malformed_packets + counters.other_version_packets, kGarbage);
  // What the vehicle sent before it had proved its address.
  EXPECT_GT(counters.refused_packets, 0u);
  EXPECT_EQ(transport.received_datagrams,
            counters.received_packets + counters.duplicate_packets + counters.malformed_packets +
                counters.other_version_packets + counters.other_packets + counters.refused_packets);
  EXPECT_EQ(road.peers().size(), 1u);
}

TEST(Node, ACardThatVanishesIsReportedAndTheOthersGoOn) {
  io::in_namespace([] {
    NodeOptions options;
    options.insecure = true;
    options.links = {{.id = LinkId{0}, .nic = "va", .peer = "10.99.0.2:9"},
                     {.id = LinkId{1}, .nic = "lo", .peer = "127.0.0.1:9"}};
    Node node(options);
    std::string reason;
    std::uint64_t sent_by_then = 0;
    node.on_nic_changed([&](const NicChanged& e) {
      reason = std::to_string(e.link.value) + ": " + std::string(to_string(e.to)) + " " + e.reason;
      sent_by_then = node.link_counters(LinkId{1}).sent_packets;
    });
    node.after(milliseconds(1), [] { io::shell("ip link del va"); });
    std::function<void()> check = [&] {
      if (!reason.empty() && node.link_counters(LinkId{1}).sent_packets > sent_by_then + 1) {
        node.stop();
      }
      node.after(milliseconds(5), check);
    };
    check();
    limit(node);
    try {
      node.run();
    } catch (const std::exception& error) {
      FAIL() << error.what();
    }
    EXPECT_EQ(reason, "0: absent unplugged") << "the reason";
    EXPECT_FALSE(node.local_address(LinkId{0})) << "its socket is closed";
    EXPECT_TRUE(node.local_address(LinkId{1}).has_value()) << "the other is there";
  });
}

TEST(Node, TheFirstLinkToThePeerMayComeLater) {
  io::in_namespace([] {
    if (!io::shell("ip link set va down")) GTEST_SKIP() << "this kernel lacks what the test needs";
    NodeOptions options;
    options.insecure = true;
    options.links = {{.id = LinkId{0}, .nic = "va", .peer = "10.99.0.2:9"},
                     {.id = LinkId{1}, .nic = "lo"}};
    Node node(options);
    EXPECT_FALSE(node.peer()) << "no peer yet";
    node.after(milliseconds(1), [] { io::shell("ip link set va up"); });
    std::function<void()> check = [&] {
      if (node.peer() && node.link_counters(LinkId{0}).sent_packets > 0) node.stop();
      node.after(milliseconds(5), check);
    };
    check();
    limit(node);
    try {
      node.run();
    } catch (const std::exception& error) {
      FAIL() << error.what();
    }
    const Statistics statistics = node.statistics();
    EXPECT_EQ(node.peers().size(), 1) << "one peer";
    EXPECT_EQ(statistics.links[0].nic_state, NicState::kReady) << "ready";
    EXPECT_GT(statistics.links[0].transport.sent_datagrams, 0) << "sent";
    EXPECT_EQ(statistics.peers.size(), 1) << "told of";
  });
}

}  // namespace
}  // namespace interneuron::node_test
