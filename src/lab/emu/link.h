// One emulated full-duplex link: a Channel that both directions share (delay process, outages, NAT)
// and a LinkModel for each direction. The simulator and the user-space emulator pass packets
// through it; a back end that can only set parameters (tc-netem) follows conditions().
//
// Pure; thread-compatible; no errors. Times are since the start of the link. Owns its models;
// moving a Link makes references to up() and down() invalid.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lab/emu/channel.h"
#include "lab/emu/link_change.h"
#include "lab/emu/link_model.h"
#include "lab/emu/profile.h"

namespace interneuron::emu {

class Link {
 public:
  // `seed` is the seed of the delay process, as of DelayProcess(profile.delay, seed); those of the
  // other random features are derived from it.
  Link(const LinkProfile& profile, std::uint64_t seed);

  LinkModel& up() { return *model(Direction::kUp); }
  LinkModel& down() { return *model(Direction::kDown); }
  const LinkModel& up() const { return models_[0]; }
  const LinkModel& down() const { return models_[1]; }

  // The delay process: to couple it before the first packet, and to compare estimates with the
  // truth. A change of the profile replaces it by one that is coupled to none.
  const std::shared_ptr<DelayProcess>& process() const { return channel_->process(); }

  // Changes the link from `now` on. Packets that still wait for a bottleneck follow the change.
  void change(Duration now, const LinkChange& change);
  // Adds an outage [from, from + length), which may lie ahead. Packets that leave a bottleneck
  // within it are lost.
  void outage(Duration from, Duration length);

  // The present properties of one direction.
  Conditions conditions(Direction direction, Duration now) const;

 private:
  LinkModel* model(Direction d) { return &models_[static_cast<std::size_t>(d)]; }

  std::uint64_t seed_;
  // How often the process was replaced; each process gets a seed of its own.
  std::uint64_t changes_ = 0;
  std::shared_ptr<Channel> channel_;
  std::array<LinkModel, kDirections> models_;
};

// What tc-netem cannot do of a profile or a change, one short line each; empty: it can do it all.
std::vector<std::string> netem_cannot(const LinkProfile& profile);
std::vector<std::string> netem_cannot(const LinkChange& change);

}  // namespace interneuron::emu
