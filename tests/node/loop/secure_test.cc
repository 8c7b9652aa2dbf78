// Nodes with keys, on the loopback card: what comes of them is encrypted, and nobody else is
// served.
#include <grp.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <memory>
#include <thread>

#include "interneuron/node.h"
#include "lab/sim/trust.h"

namespace interneuron::secure_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kPatience{60};  // no test that passes waits for it
constexpr LinkId kLinks[] = {LinkId{0}, LinkId{1}};

NodeOptions on_loopback() {
  NodeOptions options;
  options.links = {{.id = kLinks[0], .nic = "lo", .local_address = "127.0.0.1"},
                   {.id = kLinks[1], .nic = "lo", .local_address = "127.0.0.2"}};
  return options;
}

// The keys of this host, which trusts that one; the node draws the rest.
std::shared_ptr<const Security> keys(int host, int peer) {
  auto security = std::make_shared<Security>();
  security->key = sim::secret_key(host);
  security->peers = {{sim::key_of_host(peer), sim::secret_key(99)}};
  return security;
}

// A road on a thread of its own that answers every round.
class Road {
 public:
  Road() : node(options()) {
    node.on_delivered([this](Delivered d) {
      node.submit(d.round, {Bytes(d.payload.size() / 2)}, MessageClass::kResult);
    });
    thread_ = std::thread([this] { node.run(); });
  }
  ~Road() { stop(); }
  void stop() {
    node.stop();
    if (thread_.joinable()) thread_.join();
  }
  // The options of a vehicle that connects to it.
  NodeOptions vehicle() const {
    NodeOptions options = on_loopback();
    for (NodeLink& link : options.links) link.peer = to_string(*node.local_address(link.id));
    return options;
  }

  Node node;

 private:
  static NodeOptions options() {
    NodeOptions options = on_loopback();
    options.accept_peers = true;
    options.security = keys(1, 2);
    return options;
  }
  std::thread thread_;
};

LinkCounters counters_of(const Node& node) {
  LinkCounters sum;
  for (const LinkId link : kLinks) {
    const LinkCounters one = node.link_counters(link);
    sum.sent_packets += one.sent_packets;
    sum.received_packets += one.received_packets;
    sum.handshake_packets += one.handshake_packets;
    sum.unauthentic_packets += one.unauthentic_packets;
  }
  return sum;
}

// Twenty rounds with frames, and how many were answered.
std::uint32_t rounds_between(Road& road) {
  constexpr std::uint32_t kRounds = 20;
  constexpr std::size_t kFrameBytes = 100'000;
  NodeOptions options = road.vehicle();
  options.security = keys(2, 1);
  PipelineConfig pipeline{.stages = offload_stages()};
  pipeline.deadline = seconds(20);  // long, so that a slow machine with sanitizers stays on time
  options.pipelines = {pipeline};
  Node vehicle(options);
  std::uint32_t answered = 0;
  const auto next = [&] {
    vehicle.submit(vehicle.begin_round({}), {Bytes(kFrameBytes)}, MessageClass::kData);
  };
  vehicle.on_peer_ready([&](PeerReady) { next(); });
  vehicle.on_round_done([&](const RoundDone& done) {
    EXPECT_EQ(done.outcome, Outcome::kRemote);
    EXPECT_EQ(done.result, Bytes(kFrameBytes / 2));
    if (++answered == kRounds) return vehicle.stop();
    next();
  });
  vehicle.after(kPatience, [] { throw std::runtime_error("the test took too long"); });
  vehicle.run();
  road.stop();
  for (const Node* node : {&vehicle, &road.node}) {
    EXPECT_GE(counters_of(*node).handshake_packets, 1U);
    EXPECT_GT(counters_of(*node).received_packets, kRounds);
    EXPECT_EQ(counters_of(*node).unauthentic_packets, 0U);
  }
  return answered;
}

TEST(SecureNode, RoundsAreAnsweredEncrypted) {
  Road road;
  EXPECT_EQ(rounds_between(road), 20U);
}

// Sockets that are bound to NICs, handshakes and rounds as a user without a single capability.
TEST(SecureNode, NothingOfItNeedsAPrivilege) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer allows no threads in a child of fork()";
#endif
  constexpr uid_t kNobody = 65534;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const bool is_root = ::geteuid() == 0;
    if (is_root && (::setgroups(0, nullptr) != 0 || ::setresgid(kNobody, kNobody, kNobody) != 0 ||
                    ::setresuid(kNobody, kNobody, kNobody) != 0)) {
      ::_exit(2);
    }
    // Whoever gives up root has no capability left; look all the same.
    std::ifstream status("/proc/self/status");
    bool has_none = false;
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("CapEff:")) has_none = line.find_first_not_of("0 \t", 7) == line.npos;
    }
    if (!has_none) ::_exit(3);
    Road road;
    const bool good = rounds_between(road) == 20U && !testing::Test::HasFailure();
    ::_exit(good ? 0 : 1);
  }
  int result = -1;
  ASSERT_EQ(::waitpid(child, &result, 0), child);
  EXPECT_TRUE(WIFEXITED(result));
  EXPECT_EQ(WEXITSTATUS(result), 0) << "2: root cannot be given up, 3: there are capabilities left";
}

TEST(SecureNode, WhoHasNoKeyThatIsTrustedGetsNoAnswer) {
  Road road;
  NodeOptions in_the_clear = road.vehicle();
  in_the_clear.insecure = true;
  NodeOptions stranger = road.vehicle();
  stranger.security = keys(3, 1);
  for (const NodeOptions& options : {in_the_clear, stranger}) {
    Node vehicle(options);
    vehicle.on_peer_ready([](PeerReady) { ADD_FAILURE() << "was served"; });
    vehicle.after(milliseconds(500), [&vehicle] { vehicle.stop(); });
    vehicle.run();
    EXPECT_GT(counters_of(vehicle).sent_packets, 0U);
    EXPECT_EQ(counters_of(vehicle).received_packets, 0U);
    EXPECT_EQ(counters_of(vehicle).unauthentic_packets, 0U) << "what is not sent is not refused";
  }
  road.stop();
  EXPECT_GT(counters_of(road.node).unauthentic_packets, 0U);
  EXPECT_EQ(counters_of(road.node).sent_packets, 0U);
}

TEST(SecureNode, TheKeyOfAPeerIsNamedWhereSeveralAreTrusted) {
  Road road;
  NodeOptions options = road.vehicle();
  const std::pair<LinkId, Address> paths[] = {{kLinks[0], *parse_address(options.links[0].peer)}};
  for (NodeLink& link : options.links) link.peer.clear();
  auto shared = std::make_shared<Security>(*keys(2, 1));
  shared->peers.push_back({sim::key_of_host(3), {}});
  options.security = shared;
  Node vehicle(options);
  EXPECT_THROW(vehicle.connect(paths), std::invalid_argument);
  EXPECT_THROW(vehicle.connect(paths, sim::key_of_host(4)), std::invalid_argument);
  const PeerId peer = vehicle.connect(paths, sim::key_of_host(1));
  vehicle.on_peer_ready([&](PeerReady e) {
    EXPECT_EQ(e.peer, peer);
    vehicle.stop();
  });
  vehicle.after(kPatience, [] { throw std::runtime_error("the test took too long"); });
  vehicle.run();
}

TEST(SecureNode, TellsWithWhatTimeItsNextLifeHasToBegin) {
  constexpr std::int64_t kLater = std::int64_t{1} << 61;  // the year 2043
  NodeOptions options = on_loopback();
  auto security = std::make_shared<Security>(*keys(1, 2));
  security->unix_time_ns = kLater;
  options.security = security;
  EXPECT_GE(Node(options).unix_time_ns(), kLater);
  options.security.reset();
  options.insecure = true;
  EXPECT_EQ(Node(options).unix_time_ns(), 0);
}

}  // namespace
}  // namespace interneuron::secure_test
