// What a message costs a pair of Nodes, in the clear and encrypted, beside a pair of programs that
// send and receive as many bytes at the same pace by UDP with segmentation offload and nothing
// else:
//
//   build/release/bench/node_bench [--pace HZ ...] [--bytes N] [--seconds S] [--rounds N]
//
// --pace 0 is as fast as it goes, without the raw pair: a Node keeps a few messages under way and
// sends another one for each that has arrived, and what arrives in a second is told.
//
// All over one unshaped veth pair between two network namespaces, each program on a processor of
// its own if there are two; the three take turns, and the median of the rounds is told. The cost
// is the processor time of a process, in its own code and in the kernel, per message; the kernel
// charges what it does to receive from a veth to the sender. A Node's includes making a message of
// zeros, since a Node takes the bytes that it sends. Only the ratios of one run mean something.
//
// Needs user namespaces and `ip`; ends with 77 where they are not there.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/raw_udp.h"
#include "bench/two_processes.h"
#include "core/base/statistics.h"
#include "interneuron/node.h"
#include "interneuron/sizes.h"
#include "netns/state/error.h"

namespace interneuron::bench {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kUsualBytes = 256 * 1024;
constexpr std::uint16_t kNodePort = 47'002;
constexpr int kSkip = 77;

struct Options {
  std::vector<int> paces{100, 300};
  std::size_t bytes = kUsualBytes;
  double seconds = 3;
  int rounds = 3;
};

// --- nodes

// Both ends' keys; nothing: in the clear.
using Keys = std::optional<std::array<SecretKey, 2>>;

void set_keys(NodeOptions& options, const Keys& keys, std::size_t own) {
  options.insecure = !keys;
  if (!keys) return;
  auto security = std::make_shared<Security>();
  security->key = (*keys)[own];
  security->peers.push_back({public_key_of((*keys)[1 - own]), {}});
  options.security = std::move(security);
}

// Messages before those that are measured: a second of them, while the estimates settle.
std::size_t warm_up(int hertz) { return static_cast<std::size_t>(hertz); }

NodeOptions sending(const Keys& keys) {
  NodeOptions options;
  options.links.push_back({.id = LinkId{0},
                           .nic = "va",
                           .peer = std::string(kRoadAddress) + ":" + std::to_string(kNodePort)});
  set_keys(options, keys, 0);
  return options;
}

NodeOptions receiving(const Keys& keys) {
  NodeOptions options;
  options.links.push_back({.id = LinkId{0}, .nic = "vb"});
  options.accept_peers = true;
  // A peer's packets beyond the usual limit, some 1.1 Gbit/s, count as lost.
  options.peer_limits.packets_per_second = 1'000'000;
  set_keys(options, keys, 1);
  options.port = kNodePort;
  return options;
}

// What a new path is measured with is over after this.
constexpr Duration kMeasured = 2s;

// At --pace 0: so many messages are under way, whole pieces of work for both ends; and the
// estimates settle for so long.
constexpr int kUnderWay = 8;
constexpr Duration kSettling = 2s;

Cost saturate(Duration length, std::size_t bytes, const Keys& keys) {
  Node node(sending(keys));
  Cost cost;
  Usage before;
  std::size_t delivered = 0;
  bool over = false;
  const auto send = [&](PeerId peer) { node.send(peer, Bytes(bytes), {.deadline = 200ms}); };
  node.on_fate([&](const MessageFate& fate) {
    if (fate.fate == Fate::kDelivered) ++delivered;
    if (!over) send(fate.peer);
  });
  node.on_peer_ready([&](const PeerReady& ready) {
    node.after(kMeasured, [&, peer = ready.peer] {
      for (int i = 0; i < kUnderWay; ++i) send(peer);
    });
    node.after(kMeasured + kSettling, [&] {
      before = usage();
      delivered = 0;
    });
    node.after(kMeasured + kSettling + length, [&] {
      cost = cost_since(before, delivered);
      over = true;
      node.after(300ms, [&] { node.stop(); });
    });
  });
  node.after(60s, [&] { node.stop(); });
  node.run();
  return cost;
}

Cost take_all(Duration length, const Keys& keys) {
  Node node(receiving(keys));
  Cost cost;
  Usage before;
  std::optional<TimePoint> begins;
  std::size_t got = 0;
  node.on_message([&](const Message&) {
    ++got;
    if (begins) return;
    begins = node.now();
    node.after(kSettling, [&] {
      before = usage();
      got = 0;
    });
    node.after(kSettling + length, [&] {
      cost = cost_since(before, got);
      node.after(300ms, [&] { node.stop(); });
    });
  });
  node.after(60s, [&] { node.stop(); });
  node.run();
  return cost;
}

class Sender {
 public:
  Sender(int hertz, std::size_t messages, std::size_t bytes, Keys keys)
      : period_(1'000'000'000 / hertz),
        first_(warm_up(hertz)),
        last_(first_ + messages),
        bytes_(bytes),
        keys_(std::move(keys)) {}

  Cost run() {
    Node node(sending(keys_));
    node.on_peer_ready([&](const PeerReady& ready) {
      node.after(kMeasured, [&, peer = ready.peer] { send(node, peer, node.now()); });
    });
    node.on_fate([&](const MessageFate& fate) {
      if (counting_ && fate.fate == Fate::kDelivered) ++delivered_;
    });
    node.after(60s, [&] { node.stop(); });
    node.run();
    return cost_;
  }

 private:
  void send(Node& node, PeerId peer, TimePoint at) {
    if (sent_ == first_) {
      counting_ = true;
      before_ = usage();
    }
    if (sent_ == last_) {
      cost_ = cost_since(before_, last_ - first_);
      cost_.messages = static_cast<double>(delivered_);
      node.after(300ms, [&node] { node.stop(); });
      return;
    }
    ++sent_;
    Bytes message(bytes_);
    const std::int64_t now = node.now().time_since_epoch().count();
    std::memcpy(message.data(), &now, sizeof now);
    node.send(peer, std::move(message), {.deadline = 200ms});
    node.at(at + period_, [this, &node, peer, at] { send(node, peer, at + period_); });
  }

  Duration period_;
  std::size_t first_ = 0;
  std::size_t last_ = 0;
  std::size_t bytes_ = 0;
  Keys keys_;
  std::size_t sent_ = 0;
  std::size_t delivered_ = 0;
  bool counting_ = false;
  Usage before_;
  Cost cost_;
};

Cost node_receive(int hertz, std::size_t messages, const Keys& keys) {
  Node node(receiving(keys));
  const std::size_t first = warm_up(hertz);
  std::size_t got = 0;
  Usage before;
  Cost cost;
  TimePoint newest = TimePoint::max();
  std::vector<double> delays;
  node.on_message([&](const Message& message) {
    if (got == first) before = usage();
    std::int64_t sent = 0;
    std::memcpy(&sent, message.bytes.data(), sizeof sent);
    delays.push_back(static_cast<double>(node.now().time_since_epoch().count() - sent) / 1e3);
    if (got > first) cost = cost_since(before, got - first);
    newest = node.now();
    if (++got == first + messages) node.after(300ms, [&] { node.stop(); });
  });
  const std::function<void()> look = [&] {
    if (newest != TimePoint::max() && node.now() - newest > 1s) return node.stop();
    node.after(100ms, look);
  };
  node.after(100ms, look);
  node.after(60s, [&] { node.stop(); });
  node.run();
  cost.delay_us = percentile(std::move(delays), 0.5);
  return cost;
}

// --- both beside each other

void report(const char* name, int hertz, std::size_t messages, const std::vector<Pair>& rounds) {
  const auto of = [&rounds](auto value) {
    std::vector<double> values;
    for (const Pair& pair : rounds) values.push_back(value(pair));
    return percentile(values, 0.5);
  };
  fmt::print(
      "{:9} {:3} a second: send {:6.1f} µs, receive {:6.1f} µs a message, after {:5.1f} µs; page "
      "faults {:.0f} and {:.0f}; {:.0f} of {} arrived\n",
      name, hertz, of([](const Pair& p) { return p.send.us; }),
      of([](const Pair& p) { return p.receive.us; }),
      of([](const Pair& p) { return p.receive.delay_us; }),
      of([](const Pair& p) { return p.send.faults; }),
      of([](const Pair& p) { return p.receive.faults; }),
      of([](const Pair& p) { return p.receive.messages; }), messages);
}

void measure(const Options& options, int road, int hertz) {
  const auto messages = static_cast<std::size_t>(options.seconds * hertz);
  std::vector<Pair> raw;
  std::vector<Pair> nodes;
  std::vector<Pair> sealed;
  const std::size_t bytes = options.bytes;
  const Keys keys = std::array{random_key(), random_key()};
  const auto between_nodes = [=](const Keys& with) {
    return run_pair(
        road, [=] { return Sender(hertz, messages, bytes, with).run(); },
        [=] { return node_receive(hertz, messages, with); });
  };
  for (int i = 0; i < options.rounds; ++i) {
    raw.push_back(run_pair(
        road, [=] { return raw_send(hertz, messages, bytes); },
        [=] { return raw_receive(bytes); }));
    nodes.push_back(between_nodes({}));
    sealed.push_back(between_nodes(keys));
  }
  report("raw", hertz, messages, raw);
  report("clear", hertz, messages, nodes);
  report("encrypted", hertz, messages, sealed);
  const auto sum = [](const std::vector<Pair>& rounds) {
    std::vector<double> sums;
    for (const Pair& pair : rounds) sums.push_back(pair.send.us + pair.receive.us);
    return percentile(sums, 0.5);
  };
  fmt::print(
      "          {:3} a second: both ends {:.1f} and {:.1f} µs, {:.2f} times raw, raw + {:.0f} "
      "µs\n",
      hertz, sum(raw), sum(nodes), sum(nodes) / sum(raw), sum(nodes) - sum(raw));
  const auto packets = static_cast<double>((bytes + kMaxPieceBytes - 1) / kMaxPieceBytes);
  fmt::print(
      "          {:3} a second: encrypted {:.1f} µs, {:.2f} µs more for each packet and side\n",
      hertz, sum(sealed), (sum(sealed) - sum(nodes)) / packets / 2);
}

void measure_most(const Options& options, int road) {
  const Keys keys = std::array{random_key(), random_key()};
  const auto length = from_ms(options.seconds * 1000);
  const std::size_t bytes = options.bytes;
  std::vector<double> gbits[2];
  std::vector<Pair> pairs[2];
  for (int i = 0; i < options.rounds; ++i) {
    for (const bool is_encrypted : {false, true}) {
      const Keys with = is_encrypted ? keys : Keys{};
      pairs[is_encrypted].push_back(run_pair(
          road, [=] { return saturate(length, bytes, with); },
          [=] { return take_all(length, with); }));
      gbits[is_encrypted].push_back(pairs[is_encrypted].back().receive.messages *
                                    static_cast<double>(bytes) * 8e-9 / options.seconds);
    }
  }
  for (const bool is_encrypted : {false, true}) {
    const auto [least, most] = std::ranges::minmax(gbits[is_encrypted]);
    const auto us = [&](auto side) {
      std::vector<double> values;
      for (const Pair& pair : pairs[is_encrypted]) values.push_back((pair.*side).us);
      return percentile(values, 0.5);
    };
    fmt::print(
        "{:9} as fast as it goes: {:.2f} Gbit/s ({:.2f} … {:.2f}); send {:.1f} µs, receive "
        "{:.1f} µs a message\n",
        is_encrypted ? "encrypted" : "clear", percentile(gbits[is_encrypted], 0.5), least, most,
        us(&Pair::send), us(&Pair::receive));
  }
}

int run(const Options& options) {
  const auto namespaces = joined_namespaces();
  if (!namespaces) {
    fmt::print(stderr, "node_bench: cannot join two network namespaces by a veth pair\n");
    return kSkip;
  }
  const int road = namespaces->roads.front().get();
  for (const int hertz : options.paces) {
    if (hertz == 0) {
      measure_most(options, road);
    } else {
      measure(options, road, hertz);
    }
  }
  return 0;
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  interneuron::bench::Options options;
  CLI::App app("What a message costs two Nodes, beside raw UDP at the same pace.");
  app.add_option("--pace", options.paces, "Messages a second; 0: as fast as it goes")
      ->check(CLI::Range(0, 5000));
  app.add_option("--bytes", options.bytes, "Bytes of a message")->check(CLI::Range(8, 8'000'000));
  app.add_option("--seconds", options.seconds, "Seconds measured in each round");
  app.add_option("--rounds", options.rounds, "Rounds")->check(CLI::Range(1, 100));
  CLI11_PARSE(app, argc, argv);
  try {
    return interneuron::bench::run(options);
  } catch (const interneuron::netns::TestbedError& error) {
    fmt::print(stderr, "node_bench: {}\n", error.what());
    return interneuron::bench::kSkip;
  }
}
