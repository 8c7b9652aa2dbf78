// Interneuron's endpoints as they are in production, driven by the world.
#include "lab/load/fleet.h"
#include "lab/load/fleets.h"
#include "lab/load/link.h"

namespace interneuron::load {
namespace {

constexpr LinkId kLink{0};
constexpr PipelineId kPipeline{0};
constexpr std::uint32_t kRoadSession = 0x524f4144;

class Ours final : public Fleet {
 public:
  Ours(const Scenario& scenario, sim::World& world, sim::CellId cell, Meter& meter);
  void send(std::size_t vehicle, std::uint32_t number) override;

 private:
  EndpointOptions vehicle_options(std::size_t vehicle) const;

  const Scenario& s_;
  sim::World& world_;
  std::vector<sim::HostId> vehicles_;
  std::vector<PeerId> peers_;
};

// Messages go one way: a round of them ends with the delivery, and nobody answers.
EndpointOptions Ours::vehicle_options(std::size_t vehicle) const {
  PipelineConfig pipeline;
  pipeline.id = kPipeline;
  pipeline.stages = {StageKind::kCommunication, StageKind::kCommunication};
  pipeline.deadline = s_.deadline;
  pipeline.period = s_.period;
  pipeline.policy = s_.peer == Peer::kOursVariants ? "down_sampling" : "best_link";
  pipeline.guard = GuardKind::kPaper;
  pipeline.use_x = false;
  pipeline.use_handler = false;
  EndpointOptions options;
  options.session = SessionId{static_cast<std::uint32_t>(vehicle + 1)};
  options.pipelines = {pipeline};
  options.policies = builtin_policies();
  return options;
}

Ours::Ours(const Scenario& scenario, sim::World& world, sim::CellId cell, Meter& meter)
    : s_(scenario), world_(world) {
  EndpointOptions options;
  options.session = SessionId{kRoadSession};
  options.policies = builtin_policies();
  options.accept_peers = true;
  options.max_peers = scenario.vehicles;
  const sim::HostId road = world.add_host(std::move(options));
  world.on_event([&meter, &world, road](sim::HostId host, Event&& event) {
    const auto* message = std::get_if<Delivered>(&event);
    if (message == nullptr || host != road) return;
    meter.arrived(message->round.origin.value - 1, message->round.round.value, message->variant,
                  world.now());
  });
  for (std::size_t v = 0; v < scenario.vehicles; ++v) {
    vehicles_.push_back(world.add_host(vehicle_options(v)));
    join(scenario, world, vehicles_[v], road, kLink, cell);
    peers_.push_back(world.connect(vehicles_[v], road));
  }
}

// A vehicle's rounds count as the meter's messages do.
void Ours::send(std::size_t vehicle, std::uint32_t /*number*/) {
  const sim::HostId host = vehicles_[vehicle];
  Endpoint& endpoint = world_.endpoint(host);
  const RoundRef round = endpoint.begin_round(world_.local_time(host), kPipeline);
  Variants variants;
  for (const std::size_t bytes : variant_bytes(s_)) variants.emplace_back(bytes);
  endpoint.submit(world_.local_time(host), round, std::move(variants), MessageClass::kData,
                  peers_[vehicle]);
  world_.flush(host);
}

}  // namespace

std::unique_ptr<Fleet> ours(const Scenario& scenario, sim::World& world, sim::CellId cell,
                            Meter& meter) {
  return std::make_unique<Ours>(scenario, world, cell, meter);
}

}  // namespace interneuron::load
