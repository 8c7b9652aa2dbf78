// One emulated full-duplex link: a delay process, outages and a NAT that both directions share, and
// a LinkModel for each. What the simulator and the user-space emulator run, and what a back end
// that can only set parameters (tc-netem) follows by conditions().
//
// Pure; times are "since the start of the link". Thread-compatible. Movable: references to up() and
// down() move with it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lab/emu/link_change.h"
#include "lab/emu/link_model.h"
#include "lab/emu/profile.h"

namespace interneuron::emu {

class Link {
 public:
  // `seed` is that of the delay process itself: the same as DelayProcess(profile.delay, seed).
  Link(const LinkProfile& profile, std::uint64_t seed);

  LinkModel& up() { return *model(Direction::kUp); }
  LinkModel& down() { return *model(Direction::kDown); }
  const LinkModel& up() const { return models_[0]; }
  const LinkModel& down() const { return models_[1]; }

  // The delay process, for coupling before the first packet and for who wants to know the truth.
  // Another one, coupled to none, after a change of the profile.
  const std::shared_ptr<DelayProcess>& process() const { return channel_->process(); }

  // From `now` on. Packets that still wait for a bottleneck follow the change.
  void change(Duration now, const LinkChange& change);
  // No radio in [from, from + length), which may lie ahead: packets that leave a bottleneck in it
  // are lost.
  void outage(Duration from, Duration length);

  Conditions conditions(Direction direction, Duration now) const;

 private:
  LinkModel* model(Direction d) { return &models_[static_cast<std::size_t>(d)]; }

  std::uint64_t seed_;
  std::uint64_t changes_ = 0;  // of the process; each has a seed of its own
  std::shared_ptr<Channel> channel_;
  std::array<LinkModel, kDirections> models_;
};

// What of a profile tc-netem has no means for, one short line each; empty: it can do it all.
std::vector<std::string> netem_cannot(const LinkProfile& profile);
std::vector<std::string> netem_cannot(const LinkChange& change);

}  // namespace interneuron::emu
