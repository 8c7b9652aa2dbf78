#include "lab/load/link.h"

#include "lab/emu/cell.h"

namespace interneuron::load {
namespace {

// Of the links in front of the cell, and of the way back. No measurement behind these values: they
// only have to be so far above what a run sends that this plays no part.
constexpr DataRate kNicRate = DataRate::mbit(1000);
constexpr Duration kNicQueue = std::chrono::seconds(1);

}  // namespace

void join(const Scenario& scenario, sim::World& world, sim::HostId vehicle, sim::HostId road,
          LinkId link, sim::CellId cell) {
  emu::LinkProfile profile;
  profile.name = "modem";
  profile.delay = emu::constant_delay(to_ms(2 * scenario.one_way), 0);
  for (emu::DirectionParams* direction : {&profile.up, &profile.down}) {
    direction->rate = kNicRate;
    direction->queue_bytes = emu::queue_bytes_of(kNicRate, kNicQueue);
  }
  const std::uint64_t seed = emu::link_seed(scenario.seed, vehicle);
  const sim::WireId wire =
      world.add_link(vehicle, road, link, profile.name, emu::Link(profile, seed));
  world.pass_through(wire, true, cell);
}

}  // namespace interneuron::load
