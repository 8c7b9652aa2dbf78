#include "lab/load/bottleneck.h"

#include <memory>

namespace interneuron::load {
namespace {

// What the links in front of the cell and the way back have. No measurement is behind this: they
// only have to be so far above what a run sends that this plays no part.
constexpr DataRate kNicRate = DataRate::mbit(1000);
constexpr Duration kNicQueue = std::chrono::seconds(1);

}  // namespace

emu::LinkProfile modem_of(const Scenario& scenario) {
  emu::LinkProfile profile;
  profile.name = "modem";
  profile.delay = emu::constant_delay(to_ms(2 * scenario.one_way), 0);
  for (emu::DirectionParams* direction : {&profile.up, &profile.down}) {
    direction->rate = kNicRate;
    direction->queue_bytes = emu::queue_bytes_of(kNicRate, kNicQueue);
  }
  return profile;
}

emu::CellParams cell_of(const Scenario& s, Duration begin) {
  emu::CellParams cell{.rate = s.capacity, .queue_bytes = emu::queue_bytes_of(s.capacity, s.queue)};
  if (s.codel) cell.codel.emplace();
  if (s.l4s) cell.mark_above = kL4sStep;
  if (s.dip) {
    const Duration falls = begin + s.dip->at;
    const emu::SteppedRate steps{
        {{{}, s.capacity}, {falls, s.dip->rate}, {falls + s.dip->length, s.capacity}}, {}};
    cell.trace = std::make_shared<const emu::SteppedRate>(steps);
  }
  return cell;
}

}  // namespace interneuron::load
