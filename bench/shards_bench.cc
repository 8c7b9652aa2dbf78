// What several shards bring a roadside unit: one process is a Node that serves, another plays many
// vehicles that send it plain messages, over real sockets on the loopback card.
//
//   build/release/bench/shards_bench [--shards N ...] [--vehicles N] [--bytes N] [--seconds S]
//
// A line for each number of shards tells how many messages missed their deadline, how many packets
// the unit received and sent, and what its threads have had of a processor meanwhile, by the kernel
// (/proc/self/task/*/schedstat): for each packet in all, and of the busiest of the threads that
// serve, packets for each second of its. The last is what grows with the shards: they can serve so
// many packets a second where there are processors for all of them.
//
// The vehicles are Endpoints with a socket for each link and one loop for all, each from an address
// of its own, and join one after the other. Encrypted, unless --clear is given.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "bench/shards_vehicles.h"
#include "interneuron/node.h"
#include "node/io/address.h"
#include "node/io/steady_clock.h"

namespace interneuron::bench {
namespace {

// --- the roadside unit

// What each thread of this process has had of a processor so far, in seconds.
std::map<std::string, double> thread_seconds() {
  std::map<std::string, double> out;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::string name;
    double ns = 0;
    std::getline(std::ifstream(task.path() / "comm"), name);
    std::ifstream(task.path() / "schedstat") >> ns;
    const bool is_loop = task.path().filename() == std::to_string(::getpid());
    out[is_loop ? "loop" : name] += ns / 1e9;
  }
  return out;
}

struct Served {
  double packets = 0;
  double messages = 0;
  // Of a processor: of all threads, of the busiest that serves, of the loop.
  double all_s = 0;
  double busiest_s = 0;
  double loop_s = 0;
  double peers = 0;
  double drops = 0;
};

double packets_of(const Node& node, const Options& o) {
  double sum = 0;
  for (std::uint8_t i = 0; i < o.links; ++i) {
    const LinkCounters c = node.link_counters(LinkId{i});
    sum += static_cast<double>(c.received_packets + c.sent_packets);
  }
  return sum;
}

NodeOptions road_options(const Options& o, std::size_t shards, const Fleet& fleet) {
  NodeOptions options;
  for (std::uint8_t i = 0; i < o.links; ++i) {
    options.links.push_back({.id = LinkId{i}, .nic = "lo", .local_address = link_address(i)});
  }
  options.accept_peers = true;
  options.max_peers = o.vehicles;
  options.shards = shards;
  options.insecure = o.clear;
  if (!o.clear) options.security = security_of(fleet.road, fleet.vehicles);
  return options;
}

// Serves until the end of the pipe `until`; tells its ports through `to`, then what it has done.
void serve(const Options& o, std::size_t shards, const Fleet& fleet, int until, int to) {
  Node node(road_options(o, shards, fleet));
  for (std::uint8_t i = 0; i < o.links; ++i) {
    const std::uint16_t port = port_of(*node.local_address(LinkId{i}));
    if (::write(to, &port, sizeof port) != sizeof port) return;
  }
  double messages = 0;
  node.on_message([&](const Message&) { ++messages; });
  Served served;
  std::map<std::string, double> before;
  double packets_before = 0;
  std::thread watcher([&] {
    // Two bytes: the measurement begins, and ends.
    for (const bool begins : {true, false}) {
      char signal = 0;
      if (::read(until, &signal, 1) != 1) break;
      node.post([&, begins] {
        if (begins) {
          before = thread_seconds();
          packets_before = packets_of(node, o);
          messages = 0;
          return;
        }
        for (const auto& [name, now] : thread_seconds()) {
          const double spent = now - before[name];
          served.all_s += spent;
          if (name == "loop") served.loop_s = spent;
          const bool serves = shards == 1 ? name == "loop" : name.starts_with("shard ");
          if (serves) served.busiest_s = std::max(served.busiest_s, spent);
        }
        served.packets = packets_of(node, o) - packets_before;
        served.messages = messages;
        served.peers = static_cast<double>(node.peers().size());
        for (std::uint8_t i = 0; i < o.links; ++i) {
          served.drops +=
              static_cast<double>(node.transport_counters(LinkId{i}).receive_queue_drops);
        }
        node.stop();
      });
    }
  });
  node.run();
  watcher.join();
  (void)!::write(to, &served, sizeof served);
}

// --- the measurement

// How long messages are sent before those that are measured, and how far apart vehicles join.
constexpr Duration kWarmUp = 2s;
constexpr Duration kBetweenJoins = 10ms;

struct Measured {
  Tally tally;
  Served served;
  std::size_t ready = 0;
};

Measured play(const Options& o, const Fleet& fleet, int road_in, int road_out) {
  Measured out;
  std::vector<std::uint16_t> ports(o.links);
  for (std::uint16_t& port : ports) {
    if (::read(road_out, &port, sizeof port) != sizeof port) return out;
  }
  Players players(o);
  const TimePoint begin = io::now();
  for (std::size_t i = 0; i < o.vehicles; ++i) {
    players.add(std::make_unique<Vehicle>(o, io::now(), i, fleet, ports));
    players.run_until(begin + static_cast<std::int64_t>(i + 1) * kBetweenJoins);
  }
  players.run_until(io::now() + seconds(o.meet_s));
  out.ready = players.ready();
  players.begin();
  players.run_until(io::now() + kWarmUp);
  players.tally = {};
  (void)!::write(road_in, "b", 1);
  players.run_until(io::now() + seconds(o.seconds));
  (void)!::write(road_in, "e", 1);
  players.end();
  // Fates that are still to come.
  players.run_until(io::now() + 500ms);
  out.tally = players.tally;
  if (::read(road_out, &out.served, sizeof out.served) != sizeof out.served) out.served = {};
  return out;
}

Measured measure(const Options& o, std::size_t shards, const Fleet& fleet) {
  std::array<int, 2> in{};
  std::array<int, 2> told{};
  if (::pipe(in.data()) != 0 || ::pipe(told.data()) != 0) throw std::runtime_error("pipe failed");
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(in[1]);
    try {
      serve(o, shards, fleet, in[0], told[1]);
    } catch (const std::exception& error) {
      fmt::print(stderr, "road: {}\n", error.what());
    }
    ::_exit(0);
  }
  ::close(in[0]);
  ::close(told[1]);
  const Measured out = play(o, fleet, in[1], told[0]);
  ::close(in[1]);
  ::close(told[0]);
  ::waitpid(child, nullptr, 0);
  return out;
}

void tell(std::size_t shards, const Options& o, const Measured& m, double& of_one) {
  const Served& s = m.served;
  const double missed =
      static_cast<double>(m.tally.sent - std::min(m.tally.sent, m.tally.delivered));
  const double per_busy_s = s.packets / std::max(s.busiest_s, 1e-9);
  if (of_one == 0) of_one = per_busy_s;
  fmt::print("{} shards: {} of {} joined; {} messages, {:.3f} % missed ({} refused); ", shards,
             m.ready, o.vehicles, m.tally.sent,
             100 * missed / std::max<double>(1, static_cast<double>(m.tally.sent)),
             m.tally.refused);
  fmt::print(
      "{:.0f} packets a second, {:.2f} µs each in all, {:.1f} % of a core the busiest, {:.1f} % "
      "the loop; ",
      s.packets / o.seconds, s.all_s * 1e6 / std::max(s.packets, 1.0),
      100 * s.busiest_s / o.seconds, 100 * s.loop_s / o.seconds);
  fmt::print("{:.0f} packets a second of the busiest, {:.2f} times; {:.0f} dropped\n", per_busy_s,
             per_busy_s / of_one, s.drops);
  std::fflush(stdout);
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  using namespace interneuron::bench;
  Options options;
  CLI::App app("What several shards bring a roadside unit, over real sockets.");
  app.add_option("--shards", options.shards, "How many; a line for each number");
  app.add_option("--vehicles", options.vehicles, "Vehicles")->check(CLI::Range(1, 10'000));
  app.add_option("--links", options.links, "Links of every vehicle")->check(CLI::Range(1, 8));
  app.add_option("--bytes", options.bytes, "Bytes of a message");
  app.add_option("--hertz", options.hertz, "Messages of each vehicle a second");
  app.add_option("--deadline-ms", options.deadline_ms, "Their deadline, milliseconds");
  app.add_option("--meet", options.meet_s, "Seconds before the first message");
  app.add_option("--seconds", options.seconds, "Seconds measured");
  app.add_flag("--clear", options.clear, "Without keys");
  CLI11_PARSE(app, argc, argv);
  Fleet fleet;
  for (std::size_t i = 0; i < options.vehicles; ++i)
    fleet.vehicles.push_back(interneuron::random_key());
  double of_one = 0;
  for (const std::size_t shards : options.shards) {
    tell(shards, options, measure(options, shards, fleet), of_one);
  }
  return 0;
}
