// Common fading of several links: with probability c an EDGE entry on one link
// triggers an EDGE entry on each other that is STABLE, as if both modems drove behind the same
// hill. c = 0: independent, as in town; in the country bad times were seen together four times as
// often as by chance (docs/constants.md, "Three-state model").
//
// Coupled processes are made in lockstep, step by step in the order given, so that they do not
// depend on who is read first and how far. A trigger makes EDGE more frequent than the profile
// says, so the long-run figures of a coupled link are worse than its own. A triggered entry
// triggers no further one in the same step. Thread-compatible as a whole: one thread for all
// coupled links. Pure.
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
  std::vector<DelayProcess*> members_;  // null: gone
  std::vector<bool> entered_;           // EDGE, in this step
};

}  // namespace interneuron::emu
