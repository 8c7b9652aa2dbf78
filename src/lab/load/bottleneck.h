// What lies between a vehicle of a scenario and its roadside unit: a modem, which is fast both
// ways, and upwards the cell that all vehicles share. The same in virtual time and on the testbed.
// Pure.
#pragma once

#include "lab/emu/cell.h"
#include "lab/emu/profile.h"
#include "lab/load/scenario.h"

namespace interneuron::load {

emu::LinkProfile modem_of(const Scenario& scenario);

// `begin` is when messages begin, since the start of the cell: a dip counts from there.
emu::CellParams cell_of(const Scenario& scenario, Duration begin);

}  // namespace interneuron::load
