// Interneuron's endpoints as they are in production, driven by the world.
#include <numeric>
#include <utility>

#include "lab/load/bottleneck.h"
#include "lab/load/fleet.h"
#include "lab/sim/duo.h"
#include "lab/sim/trust.h"

namespace interneuron::load {
namespace {

constexpr LinkId kModem{0};
// The road's key; vehicles have those that follow.
constexpr int kRoadKey = 1;
// What a message begins with: its number, and above these bits that of its vehicle.
constexpr unsigned kNumberBits = 32;

class Ours final : public Fleet {
 public:
  Ours(const Scenario& scenario, sim::World& world, sim::CellId cell, Meter& meter)
      : world_(world), hosts_(scenario, world, {}, [&](sim::HostId vehicle, sim::HostId road) {
          join(scenario, world, vehicle, road, kModem, cell);
        }) {
    world.on_event([&meter, &world, road = hosts_.road](sim::HostId host, Event&& event) {
      const auto* message = std::get_if<Message>(&event);
      if (message == nullptr || host != road) return;
      const std::uint64_t number = sim::number_of(message->bytes);
      meter.arrived(number >> kNumberBits, static_cast<std::uint32_t>(number), message->variant,
                    world.now());
    });
  }
  void send(std::size_t vehicle, std::uint32_t number) override {
    // What is refused has missed its deadline.
    static_cast<void>(hosts_.send(vehicle, std::uint64_t{vehicle} << kNumberBits | number));
    world_.flush(hosts_.vehicles[vehicle]);
  }

 private:
  sim::World& world_;
  OurHosts hosts_;
};

}  // namespace

void join(const Scenario& scenario, sim::World& world, sim::HostId vehicle, sim::HostId road,
          LinkId link, sim::CellId cell) {
  const emu::LinkProfile profile = modem_of(scenario);
  const std::uint64_t seed = emu::link_seed(scenario.seed, vehicle);
  const sim::WireId wire =
      world.add_link(vehicle, road, link, profile.name, emu::Link(profile, seed));
  world.pass_through(wire, true, cell);
}

std::string policy_of(Peer peer) {
  return peer == Peer::kOursVariants ? "down_sampling" : "best_link";
}

OurHosts::OurHosts(const Scenario& scenario, sim::World& world, EndpointOptions vehicle,
                   const std::function<void(sim::HostId vehicle, sim::HostId road)>& links)
    : s_(scenario), world_(world) {
  if (vehicle.policies.empty()) vehicle.policies = builtin_policies();
  EndpointOptions options;
  options.session = SessionId{kRoadSession};
  options.policies = vehicle.policies;
  options.accept_peers = true;
  options.max_peers = scenario.vehicles;
  std::vector<int> keys(scenario.vehicles);
  std::iota(keys.begin(), keys.end(), kRoadKey + 1);
  if (scenario.is_encrypted) options.security = sim::security_of(kRoadKey, keys);
  const std::vector<Duration> joined = joins(scenario);
  peers.resize(scenario.vehicles);
  road = world.add_host(std::move(options));
  for (std::uint32_t v = 0; v < scenario.vehicles; ++v) {
    vehicle.session = SessionId{v + 1};
    if (scenario.is_encrypted) vehicle.security = sim::security_of(keys[v], {kRoadKey});
    vehicles.push_back(world.add_host(vehicle));
    links(vehicles[v], road);
    if (joined[v] == Duration{}) {
      peers[v] = world.connect(vehicles[v], road);
    } else {
      world.at(joined[v], [this, v] {
        peers[v] = world_.connect(vehicles[v], road);
        world_.flush(vehicles[v]);
      });
    }
  }
}

SendResult OurHosts::send(std::size_t vehicle, std::uint64_t number) {
  const sim::HostId host = vehicles[vehicle];
  return world_.endpoint(host).send(world_.local_time(host), peers[vehicle], variants(number),
                                    {.deadline = s_.deadline, .policy = policy_of(s_.peer)});
}

Variants OurHosts::variants(std::uint64_t number) const {
  return sim::numbered(variant_bytes(s_), number);
}

std::unique_ptr<Fleet> ours(const Scenario& scenario, sim::World& world, sim::CellId cell,
                            Meter& meter) {
  return std::make_unique<Ours>(scenario, world, cell, meter);
}

}  // namespace interneuron::load
