// Plays a scenario: makes its links and applies its events and coverage holes to them as time goes
// on. The simulator and both back ends of the testbed use the same player, so that a scenario means
// the same in all.
//
// Pure; thread-compatible; no errors. Owns the links, whose addresses never change.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "lab/emu/link.h"
#include "lab/emu/random.h"
#include "lab/emu/scenario.h"

namespace interneuron::emu {

class ScenarioPlayer {
 public:
  explicit ScenarioPlayer(Scenario scenario);

  std::size_t size() const { return links_.size(); }
  Link& link(std::size_t i) { return *links_[i]; }
  const Scenario& scenario() const { return scenario_; }

  // Applies everything that is due at `now`, which never goes back.
  void play(Duration now);
  // When play() has something to do next; empty: never again.
  std::optional<Duration> next() const;

 private:
  void announce_holes(Duration until);

  Scenario scenario_;
  std::vector<std::unique_ptr<Link>> links_;
  std::size_t next_event_ = 0;
  RandomStream hole_stream_;
  // The beginning of the next coverage hole of which the links have not been told yet.
  Duration hole_from_ = Duration::max();
};

}  // namespace interneuron::emu
