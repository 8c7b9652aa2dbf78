#include "lab/load/link.h"

#include "lab/load/bottleneck.h"

namespace interneuron::load {

void join(const Scenario& scenario, sim::World& world, sim::HostId vehicle, sim::HostId road,
          LinkId link, sim::CellId cell) {
  const emu::LinkProfile profile = modem_of(scenario);
  const std::uint64_t seed = emu::link_seed(scenario.seed, vehicle);
  const sim::WireId wire =
      world.add_link(vehicle, road, link, profile.name, emu::Link(profile, seed));
  world.pass_through(wire, true, cell);
}

}  // namespace interneuron::load
