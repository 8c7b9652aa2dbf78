// Interneuron's endpoints as they are in production, driven by the world.
#include <cstring>
#include <numeric>
#include <utility>

#include "lab/load/fleet.h"
#include "lab/load/fleets.h"
#include "lab/load/link.h"
#include "lab/sim/trust.h"

namespace interneuron::load {
namespace {

constexpr LinkId kModem{0};

// What every message begins with, so that the receiver can tell the meter which one it is.
struct Label {
  std::uint32_t vehicle = 0;
  std::uint32_t number = 0;
};

class Ours final : public Fleet {
 public:
  Ours(const Scenario& scenario, sim::World& world, sim::CellId cell, Meter& meter);
  void send(std::size_t vehicle, std::uint32_t number) override;

 private:
  const Scenario& s_;
  sim::World& world_;
  std::vector<sim::HostId> vehicles_;
  std::vector<PeerId> peers_;
};

// The road's key; vehicles have those that follow.
constexpr int kRoadKey = 1;

EndpointOptions options_of(std::uint32_t session) {
  EndpointOptions options;
  options.session = SessionId{session};
  options.policies = builtin_policies();
  return options;
}

Ours::Ours(const Scenario& scenario, sim::World& world, sim::CellId cell, Meter& meter)
    : s_(scenario), world_(world) {
  EndpointOptions options = options_of(kRoadSession);
  options.accept_peers = true;
  options.max_peers = scenario.vehicles;
  std::vector<int> keys(scenario.vehicles);
  std::iota(keys.begin(), keys.end(), kRoadKey + 1);
  if (scenario.is_encrypted) options.security = security_of(kRoadKey, keys);
  const sim::HostId road = world.add_host(std::move(options));
  world.on_event([&meter, &world, road](sim::HostId host, Event&& event) {
    const auto* message = std::get_if<Message>(&event);
    if (message == nullptr || host != road) return;
    Label label;
    std::memcpy(&label, message->bytes.data(), sizeof label);
    meter.arrived(label.vehicle, label.number, message->variant, world.now());
  });
  for (std::uint32_t v = 0; v < scenario.vehicles; ++v) {
    EndpointOptions vehicle = options_of(v + 1);
    if (scenario.is_encrypted) vehicle.security = security_of(keys[v], {kRoadKey});
    vehicles_.push_back(world.add_host(std::move(vehicle)));
    join(scenario, world, vehicles_[v], road, kModem, cell);
    peers_.push_back(world.connect(vehicles_[v], road));
  }
}

void Ours::send(std::size_t vehicle, std::uint32_t number) {
  const Label label{static_cast<std::uint32_t>(vehicle), number};
  Variants variants;
  for (const std::size_t bytes : variant_bytes(s_)) {
    variants.emplace_back(std::max(bytes, sizeof label));
    std::memcpy(variants.back().data(), &label, sizeof label);
  }
  const sim::HostId host = vehicles_[vehicle];
  SendOptions options;
  options.deadline = s_.deadline;
  options.policy = s_.peer == Peer::kOursVariants ? "down_sampling" : "best_link";
  // What is refused has missed its deadline.
  static_cast<void>(world_.endpoint(host).send(world_.local_time(host), peers_[vehicle],
                                               std::move(variants), options));
  world_.flush(host);
}

}  // namespace

std::unique_ptr<Fleet> ours(const Scenario& scenario, sim::World& world, sim::CellId cell,
                            Meter& meter) {
  return std::make_unique<Ours>(scenario, world, cell, meter);
}

}  // namespace interneuron::load
