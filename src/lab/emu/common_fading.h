// Common fading of several links: when one link enters EDGE, each other that is STABLE enters EDGE
// as well with probability c, as if both modems drove behind the same hill. With c = 0 links are
// independent, as was measured in town; in the country bad times came together four times as often
// as by chance (docs/constants.md, "Three-state model").
//
// Coupled processes make their steps together, in the order given, so that their values do not
// depend on which is read first and how far. Coupling makes EDGE more frequent than the profile
// says, so the long-run figures of a coupled link are worse than the profile's. An entry caused by
// another link causes no further ones in the same step. Pure. Thread-compatible as a whole: one
// thread uses all coupled links. A group lives as long as one of its processes, and none owns
// another.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "lab/emu/delay_process.h"
#include "lab/emu/random.h"

namespace interneuron::emu {

// Couples processes that have not been read yet, for as long as they live. c in [0, 1]; with 0, or
// fewer than two, nothing changes. A process belongs to at most one group.
void couple(std::span<const std::shared_ptr<DelayProcess>> processes, double c, std::uint64_t seed);

// The group; private to couple() and DelayProcess.
class CommonFading {
 public:
  CommonFading(double c, std::uint64_t seed) : c_(c), stream_(seed) {}

  static void join(const std::shared_ptr<CommonFading>& group, DelayProcess& process);
  void remove(const DelayProcess& process);
  // Makes one step of every member.
  void make_step();

 private:
  double c_;
  RandomStream stream_;
  // nullptr for a process that has been destroyed.
  std::vector<DelayProcess*> members_;
  // Which members have entered EDGE in the present step.
  std::vector<bool> entered_;
};

}  // namespace interneuron::emu
