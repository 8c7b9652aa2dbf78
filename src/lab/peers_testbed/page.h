// The rows of `bench peers` as tables for a page: a line for each peer, a column for each
// condition. Pure; thread-safe; no errors.
#pragma once

#include <string>
#include <vector>

#include "lab/peers_testbed/figures.h"

namespace interneuron::peers {

// Markdown. Conditions under which the same peers were run share a table. A cell has the messages
// that were missed, in brackets those in a smaller variant, and the bytes sent per byte. Processor
// time is of the first condition of a table.
std::string page_of(const std::vector<Row>& rows);

}  // namespace interneuron::peers
