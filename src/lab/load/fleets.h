// The two kinds of fleets, for make_fleet().
#pragma once

#include "lab/load/fleet.h"

namespace interneuron::load {

std::unique_ptr<Fleet> ours(const Scenario& scenario, sim::World& world, sim::CellId cell,
                            Meter& meter);
std::unique_ptr<Fleet> foreigners(const Scenario& scenario, sim::World& world, sim::CellId cell,
                                  Meter& meter);

}  // namespace interneuron::load
