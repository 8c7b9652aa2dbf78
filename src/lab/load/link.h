// How a host of a scenario reaches another: a link that is fast both ways, and up through the cell.
#pragma once

#include "lab/load/scenario.h"
#include "lab/sim/world.h"

namespace interneuron::load {

// Adds the link from `vehicle` to `road`.
void join(const Scenario& scenario, sim::World& world, sim::HostId vehicle, sim::HostId road,
          LinkId link, sim::CellId cell);

}  // namespace interneuron::load
