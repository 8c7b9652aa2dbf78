// What a packet costs the simulator: processor time per packet of many vehicles that share one cell
// towards one roadside unit, in virtual time. Once with hosts that only send and swallow packets,
// which is the World alone, and once with Endpoints, which is what experiments take.
//
//   build/release/bench/world_bench --vehicles 1000 --seconds 10
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <memory>
#include <vector>

#include "interneuron/pipeline.h"
#include "lab/sim/world.h"

namespace interneuron::bench {
namespace {

using namespace sim;
using namespace std::chrono_literals;

constexpr LinkId kNic{0};
constexpr Duration kPeriod = 100ms;
constexpr std::size_t kPacketBytes = 1400;

struct Options {
  std::size_t vehicles = 1000;
  int seconds = 10;
  std::size_t message_bytes = 5000;
};

// Sends the packets of one message each period.
class Sender : public ForeignHost {
 public:
  Sender(Address to, Duration first, std::size_t packets)
      : to_(to), next_(first), packets_(packets), left_(packets) {}

  void handle_packet(Duration, const ForeignPacket&) override {}
  void handle_timeout(Duration) override {}
  std::optional<ForeignPacket> poll_transmit(Duration now) override {
    if (now < next_ || packets_ == 0) return std::nullopt;
    if (--left_ == 0) {
      left_ = packets_;
      next_ += kPeriod;
    }
    return ForeignPacket{kNic, to_, kPacketBytes, Ecn::kNotEct, {}};
  }
  std::optional<Duration> next_timeout(Duration) const override {
    if (packets_ == 0) return std::nullopt;
    return next_;
  }

 private:
  Address to_;
  Duration next_;
  std::size_t packets_;
  std::size_t left_;
};

// Twice the rate that the messages need, and a deep queue: nothing is lost.
emu::CellParams cell_for(const Options& o) {
  emu::CellParams params;
  const double per_s = std::chrono::duration<double>(1s) / std::chrono::duration<double>(kPeriod);
  params.rate =
      DataRate::mbit(static_cast<double>(o.vehicles * o.message_bytes) * 8 * per_s * 2e-6);
  params.queue_bytes = emu::queue_bytes_of(params.rate, 300ms);
  return params;
}

emu::Link access(std::uint64_t seed) {
  emu::LinkProfile profile;
  profile.delay = emu::constant_delay(40, 0);
  profile.up.rate = profile.down.rate = DataRate::mbit(1000);
  profile.up.queue_bytes = profile.down.queue_bytes = 10'000'000;
  return {profile, seed};
}

Duration phase(const Options& o, std::size_t vehicle) {
  return kPeriod * static_cast<std::int64_t>(vehicle) / static_cast<std::int64_t>(o.vehicles);
}

// Runs the world and says what its packets through the cell have cost.
void measure(const char* what, World& world, CellId cell, const Options& o) {
  const std::clock_t began = std::clock();
  world.run_until(std::chrono::seconds(o.seconds));
  const double spent = static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;
  const auto packets = static_cast<double>(world.cell(cell).stats().packets_in);
  fmt::print("{:10} {:5} vehicles, {} s: {:7.2f} s of CPU, {:9.0f} packets up, {:6.2f} us each\n",
             what, o.vehicles, o.seconds, spent, packets, spent * 1e6 / packets);
}

void foreign(const Options& o) {
  World world(1);
  const CellId cell = world.add_cell(cell_for(o));
  const HostId road = world.add_foreign(std::make_unique<Sender>(Address{}, Duration{}, 0));
  const std::size_t packets = (o.message_bytes + kPacketBytes - 1) / kPacketBytes;
  for (std::size_t v = 0; v < o.vehicles; ++v) {
    const HostId host = world.add_foreign(
        std::make_unique<Sender>(World::address_of(road, kNic), phase(o, v), packets));
    world.pass_through(world.add_link(host, road, kNic, "nic", access(v)), true, cell);
  }
  measure("packets", world, cell, o);
}

EndpointOptions endpoint(std::size_t number, std::size_t peers) {
  EndpointOptions options;
  options.session = SessionId{static_cast<std::uint32_t>(number + 1)};
  options.policies = builtin_policies();
  options.accept_peers = peers > 0;
  options.max_peers = std::max<std::size_t>(peers, 1);
  if (peers > 0) return options;
  PipelineConfig pipeline{.stages = {StageKind::kCommunication, StageKind::kCommunication},
                          .period = kPeriod,
                          .policy = "best_link"};
  options.pipelines = {pipeline};
  return options;
}

void endpoints(const Options& o) {
  World world(1);
  const CellId cell = world.add_cell(cell_for(o));
  const HostId road = world.add_host(endpoint(o.vehicles, o.vehicles));
  std::vector<PeerId> peers;
  for (std::size_t v = 0; v < o.vehicles; ++v) {
    const HostId host = world.add_host(endpoint(v, 0));
    world.pass_through(world.add_link(host, road, kNic, "nic", access(v)), true, cell);
    peers.push_back(world.connect(host, road));
    for (Duration at = 1s + phase(o, v); at < std::chrono::seconds(o.seconds); at += kPeriod) {
      world.at(at, [&world, &peers, &o, host, v] {
        Endpoint& e = world.endpoint(host);
        const RoundRef round = e.begin_round(world.local_time(host), PipelineId{0});
        e.submit(world.local_time(host), round, {Bytes(o.message_bytes)}, MessageClass::kData,
                 peers[v]);
        world.flush(host);
      });
    }
  }
  measure("endpoints", world, cell, o);
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  interneuron::bench::Options options;
  CLI::App app("What a packet costs the simulator");
  app.add_option("--vehicles", options.vehicles, "Vehicles on one cell")
      ->check(CLI::Range(1, 100000));
  app.add_option("--seconds", options.seconds, "Virtual time")->check(CLI::Range(2, 3600));
  app.add_option("--bytes", options.message_bytes, "Of each message, ten a second per vehicle")
      ->check(CLI::Range(1, 1000000));
  CLI11_PARSE(app, argc, argv);
  interneuron::bench::foreign(options);
  interneuron::bench::endpoints(options);
  return 0;
}
