// NICs that go and come back under a vehicle and a roadside unit that are at work: two processes,
// two network namespaces, two veth pairs.
//
//   vehicle  va 10.99.0.1 ── vb 10.99.0.2  road
//            wa 10.98.0.1 ── wb 10.98.0.2
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/node.h"
#include "node/io/open_transport.h"
#include "node/io/steady_clock.h"
#include "tests/node/io/namespace.h"
#include "tests/node/io/support.h"

namespace interneuron::hot_plug_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds kSeenWithin{200};
constexpr seconds kUsedWithin{1};
constexpr seconds kPatience{60};  // no test that passes waits for it
constexpr std::uint16_t kPort = 47000;
constexpr LinkId kLink{0};  // the one that comes and goes

bool shell_all(const std::vector<std::string>& commands) {
  return std::ranges::all_of(commands, io::shell);
}

NodeOptions road_options() {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{0}, .nic = "vb"}, {.id = LinkId{1}, .nic = "wb"}};
  options.port = kPort;
  options.accept_peers = true;
  return options;
}

NodeOptions vehicle_options(TransportKind transport) {
  NodeOptions options;
  options.insecure = true;
  options.transport = transport;
  options.links = {{.id = LinkId{0}, .nic = "va", .peer = "10.99.0.2:47000"},
                   {.id = LinkId{1}, .nic = "wa", .peer = "10.98.0.2:47000"}};
  PipelineConfig pipeline{
      .stages = offload_stages(), .deadline = milliseconds(500), .period = milliseconds(20)};
  options.pipelines = {pipeline};
  return options;
}

// The roadside unit, in a process and a network namespace of its own; answers every message.
class Road {
 public:
  Road() {
    int made[2];
    int go[2];
    if (::pipe(made) != 0 || ::pipe(go) != 0) return;
    child_ = ::fork();
    if (child_ == 0) {
      char byte = ::unshare(CLONE_NEWNET) == 0 ? 'y' : 'n';
      if (::write(made[1], &byte, 1) != 1 || ::read(go[0], &byte, 1) != 1) ::_exit(1);
      ::_exit(serve(made[1]));
    }
    char byte = 'n';
    made_ = ::read(made[0], &byte, 1) == 1 && byte == 'y' && wire_pair("va", "vb", 99) &&
            wire_pair("wa", "wb", 98) && ::write(go[1], &byte, 1) == 1 &&
            ::read(made[0], &byte, 1) == 1 && byte == 'y';
    for (const int fd : {made[0], made[1], go[0], go[1]}) ::close(fd);
  }
  ~Road() {
    ::kill(child_, SIGTERM);
    int status = 0;
    ::waitpid(child_, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }
  Road(const Road&) = delete;
  Road& operator=(const Road&) = delete;

  bool made() const { return made_; }

  // Plugs a pair and configures it at both ends.
  bool wire_pair(const std::string& a, const std::string& b, int net) const {
    const std::string here = "10." + std::to_string(net) + ".0.1/24";
    const std::string there = "10." + std::to_string(net) + ".0.2/24";
    io::shell("ip link del " + a);
    return shell_all({"ip link add " + a + " type veth peer name " + b,
                      "ip link set " + b + " netns " + std::to_string(child_)}) &&
           inside("ip addr add " + there + " dev " + b) && inside("ip link set " + b + " up") &&
           shell_all({"ip addr add " + here + " dev " + a, "ip link set " + a + " up"});
  }
  bool inside(const std::string& command) const {
    return io::shell("nsenter -t " + std::to_string(child_) + " -n " + command);
  }
  pid_t pid() const { return child_; }

 private:
  static int serve(int ready) {
    try {
      Node node(road_options());
      node.on_delivered([&](Delivered message) {
        node.submit(message.round, {Bytes(100)}, MessageClass::kResult);
      });
      node.stop_on_signals();
      const char byte = 'y';
      if (::write(ready, &byte, 1) != 1) return 1;
      node.run();
    } catch (const std::exception& error) {
      std::printf("road: %s\n", error.what());
      return 1;
    }
    return 0;
  }

  pid_t child_ = -1;
  bool made_ = false;
};

// What is done to a NIC from outside, and what must come of it.
struct Step {
  std::string name;
  std::function<bool()> act;
  NicState becomes{};
};

// A vehicle that begins a round every 20 ms while a worker takes one step after the other.
class Vehicle {
 public:
  Vehicle(std::vector<Step> steps, TransportKind transport)
      : steps_(std::move(steps)), node_(vehicle_options(transport)) {}

  void run() {
    node_.on_round_done([this](RoundDone done) {
      ++done_;
      remote_ += done.outcome == Outcome::kRemote ? 1 : 0;
    });
    node_.on_nic_changed([this](const NicChanged& change) {
      if (change.link != kLink) return;
      state_ = change.to;
      ++changes_;
      changed_at_ = node_.now();
      std::printf("    %s: %s\n", std::string(to_string(change.to)).c_str(), change.reason.c_str());
    });
    node_.on_path_changed([](const PathChanged& change) {
      std::printf("    path %u: %s, %s\n", unsigned{change.link.value},
                  std::string(to_string(change.to)).c_str(), change.reason.c_str());
    });
    node_.on_peer_ready([this](PeerReady) {
      if (std::exchange(began_, true)) return;
      begin_rounds();
      await_use(node_.now(), [this] { next(); });
    });
    node_.after(kPatience, [this] { fail("the test took too long"); });
    node_.run();
    EXPECT_EQ(done_, begun_) << "every round is answered";
    EXPECT_GE(remote_ * 10, done_ * 9) << "nine of ten remotely";
  }
  Node& node() { return node_; }

 private:
  void fail(const std::string& what) {
    ADD_FAILURE() << what;
    node_.stop();
  }

  void begin_rounds() {
    if (finished_) return;
    const RoundRef round = node_.begin_round(PipelineId{0});
    ++begun_;
    node_.submit(round, {Bytes(20'000)}, MessageClass::kData);
    node_.local_result(round, Bytes(1));
    node_.after(milliseconds(20), [this] { begin_rounds(); });
  }

  void next() {
    if (at_ == steps_.size()) {
      finished_ = true;
      return await(
          "all rounds are answered", kPatience, [this] { return done_ == begun_; },
          [this](Duration) { node_.stop(); });
    }
    const Step& step = steps_[at_++];
    node_.compute(Queue::kComputation, [this, &step, before = changes_] {
      const bool ok = step.act();
      const TimePoint end = io::now();
      return [this, &step, before, ok, end] {
        if (!ok) return fail("failed: " + step.name);
        await(
            step.name, kPatience,
            [this, &step, before] { return changes_ > before && state_ == step.becomes; },
            [this, &step, end](Duration) { judge(step, end); });
      };
    });
  }

  void judge(const Step& step, TimePoint end) {
    const Duration took = std::max(changed_at_ - end, Duration::zero());
    std::printf("%6.1f ms until seen: %s\n",
                std::chrono::duration<double, std::milli>(took).count(), step.name.c_str());
    EXPECT_LE(took, kSeenWithin);
    if (step.becomes != NicState::kReady) {
      if (node_.local_address(kLink)) return fail("its socket is closed");
      return node_.after(milliseconds(100), [this] { next(); });  // rounds go on without it
    }
    await_use(changed_at_, [this] { next(); });
  }

  // Until the peer is heard over the link again and new data may go over it.
  void await_use(TimePoint since, std::function<void()> then) {
    const std::uint64_t heard = node_.link_counters(kLink).received_packets;
    await(
        "the link is used", kPatience,
        [this, heard] {
          const auto states = node_.links(*node_.peer());
          const auto link = std::ranges::find(states, kLink, &LinkState::id);
          return link != states.end() && link->up &&
                 node_.link_counters(kLink).received_packets > heard;
        },
        [this, since, then](Duration) {
          const Duration took = node_.now() - since;
          std::printf("%6.1f ms until used\n",
                      std::chrono::duration<double, std::milli>(took).count());
          EXPECT_LE(took, kUsedWithin);
          then();
        });
  }

  void await(const std::string& what, Duration patience, std::function<bool()> condition,
             std::function<void(Duration)> then, std::optional<TimePoint> since = std::nullopt) {
    const TimePoint start = since.value_or(node_.now());
    if (condition()) return then(node_.now() - start);
    if (node_.now() - start > patience) return fail("waited for: " + what);
    node_.after(milliseconds(2), [=, this] { await(what, patience, condition, then, start); });
  }

  std::vector<Step> steps_;
  Node node_;
  std::size_t at_ = 0;
  NicState state_ = NicState::kReady;
  int changes_ = 0;
  TimePoint changed_at_{};
  bool began_ = false;
  bool finished_ = false;
  int begun_ = 0;
  int done_ = 0;
  int remote_ = 0;
};

void run_steps(const std::function<std::vector<Step>(const Road&)>& steps,
               TransportKind transport = TransportKind::kUdp) {
  const auto body = [&] {
    const std::size_t before = io::open_descriptors();
    {
      const Road road;
      if (!road.made()) GTEST_SKIP() << "this kernel lacks what the test needs";
      try {
        Vehicle vehicle(steps(road), transport);
        const std::size_t at_start = io::open_descriptors();
        vehicle.run();
        // The sockets of two links and the monitor's; each incarnation gave its own back.
        EXPECT_LE(io::open_descriptors(), at_start) << "no descriptor is left open";
      } catch (const std::exception& error) {
        FAIL() << error.what();
      }
    }
    EXPECT_EQ(io::open_descriptors(), before) << "nothing is left open";
  };
  const bool is_xdp = transport == TransportKind::kXdp;
  io::in_namespace(body, is_xdp ? io::Root::kOfHost : io::Root::kOfNamespace);
}

std::function<bool()> command(const std::string& text) {
  return [text] { return io::shell(text); };
}

TEST(HotPlug, DownAndUp) {
  run_steps([](const Road&) {
    return std::vector<Step>{{"down", command("ip link set va down"), NicState::kNoCarrier},
                             {"up", command("ip link set va up"), NicState::kReady},
                             {"down again", command("ip link set va down"), NicState::kNoCarrier},
                             {"up again", command("ip link set va up"), NicState::kReady}};
  });
}

TEST(HotPlug, TheOtherEndGoesDownAndUp) {
  run_steps([](const Road& road) {
    return std::vector<Step>{
        {"the road's end down", [&] { return road.inside("ip link set vb down"); },
         NicState::kNoCarrier},
        {"the road's end up", [&] { return road.inside("ip link set vb up"); }, NicState::kReady}};
  });
}

TEST(HotPlug, TheOtherEndGoesDownAndUpUnderAProgram) {
  try {
    io::require_privilege(TransportKind::kXdp);
  } catch (const IoError& error) {
    GTEST_SKIP() << error.what();
  }
  run_steps(
      [](const Road& road) {
        return std::vector<Step>{
            {"the road's end down", [&] { return road.inside("ip link set vb down"); },
             NicState::kNoCarrier},
            {"the road's end up", [&] { return road.inside("ip link set vb up"); },
             NicState::kReady},
            {"unplugged", command("ip link del va"), NicState::kAbsent},
            {"plugged in", [&] { return road.wire_pair("va", "vb", 99); }, NicState::kReady}};
      },
      TransportKind::kXdp);
}

TEST(HotPlug, UnpluggedAndPluggedIn) {
  run_steps([](const Road& road) {
    return std::vector<Step>{
        {"unplugged", command("ip link del va"), NicState::kAbsent},
        {"plugged in", [&] { return road.wire_pair("va", "vb", 99); }, NicState::kReady},
        {"unplugged again", command("ip link del va"), NicState::kAbsent},
        {"plugged in again", [&] { return road.wire_pair("va", "vb", 99); }, NicState::kReady}};
  });
}

TEST(HotPlug, RenamedCardsGoOn) {
  run_steps([](const Road&) {
    return std::vector<Step>{{"down", command("ip link set va down"), NicState::kNoCarrier},
                             {"renamed", command("ip link set va name wan0"), NicState::kNoCarrier},
                             {"up", command("ip link set wan0 up"), NicState::kReady}};
  });
}

TEST(HotPlug, ACardWhosePacketsAreTooSmallIsRefusedInWords) {
  io::in_namespace([] {
    NodeOptions options;
    options.insecure = true;
    options.links = {{.id = kLink, .nic = "va"}};
    Node node(options);
    std::string told;
    node.on_nic_changed([&](const NicChanged& change) {
      if (!change.is_warning) return;
      told = change.reason;
      node.stop();
    });
    node.after(kPatience, [&node] { node.stop(); });
    node.post([] { io::shell("ip link set va mtu 1200"); });
    node.run();
    EXPECT_EQ(told, "va has an MTU of 1200 bytes, and at least 1228 are needed; set it to 1280");
    EXPECT_THROW(Node another(options), IoError);
  });
}

TEST(HotPlug, MovedToAnotherNamespaceAndBack) {
  run_steps([](const Road& road) {
    const std::string self = std::to_string(::getpid());
    return std::vector<Step>{
        {"moved away", command("ip link set va netns " + std::to_string(road.pid())),
         NicState::kAbsent},
        {"moved back",
         [&road, self] {
           return road.inside("ip link set va netns " + self) &&
                  shell_all({"ip addr add 10.99.0.1/24 dev va", "ip link set va up"});
         },
         NicState::kReady}};
  });
}

TEST(HotPlug, AddressRouteAndMtu) {
  run_steps([](const Road&) {
    return std::vector<Step>{
        {"address gone", command("ip addr del 10.99.0.1/24 dev va"), NicState::kNoAddress},
        {"another address", command("ip addr add 10.99.0.7/24 dev va"), NicState::kReady},
        {"route gone", command("ip route del 10.99.0.0/24"), NicState::kNoRoute},
        {"route back", command("ip route add 10.99.0.0/24 dev va"), NicState::kReady},
        {"another MTU", command("ip link set va mtu 1300"), NicState::kReady}};
  });
}

}  // namespace
}  // namespace interneuron::hot_plug_test
