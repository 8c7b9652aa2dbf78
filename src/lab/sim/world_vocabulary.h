// The words of a World: its hosts, links and cells by number, and what may go wrong on a link
// beside what emulated links do. Plain values. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"
#include "lab/emu/ecn.h"

namespace interneuron::sim {

// A host, in the order in which it was added.
using HostId = std::size_t;
// A link as the world counts them, in the order of World::add_link(): unlike the LinkId by which
// its two hosts know it, it belongs to one link only. Cells count its packets as the flow of this
// number.
using WireId = Id<struct WireTag, std::uint32_t>;
// A shared bottleneck, in the order of World::add_cell().
using CellId = Id<struct CellTag, std::uint32_t>;

// Faults of a link beside those of its LinkModel, for property tests. Probabilities are per packet
// and direction.
struct Faults {
  double loss = 0;
  double duplicate = 0;
  // The packet is delivered up to reorder_by later, so that later ones overtake it.
  double reorder = 0;
  Duration reorder_by{};
  // Nothing passes.
  bool cut = false;
  // What the ECN bits of packets that have any become.
  std::optional<emu::Ecn> ecn{};
  // Packets with any do not pass.
  bool drops_ect = false;
};

}  // namespace interneuron::sim
