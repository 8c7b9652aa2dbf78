// The packets of a World that are on their way, by tag: the handle that emulated links and cells
// keep of them. A released packet keeps its memory for the next one, so that nothing is allocated
// in the steady state. No bound of its own: what links and cells hold bounds it. Pure;
// thread-compatible; no errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/round.h"
#include "interneuron/units.h"
#include "lab/emu/ecn.h"

namespace interneuron::sim {

// A packet that a host hands over.
struct LeavingPacket {
  LinkId link{};
  Address to{};
  std::size_t ip_bytes = 0;
  emu::Ecn ecn = emu::Ecn::kNotEct;
  ByteView bytes;
  // As in Transmit; nothing in what a foreign host sends.
  std::optional<RoundRef> round{};
};

struct PacketOnItsWay {
  Bytes bytes;
  std::size_t ip_bytes = 0;
  emu::Ecn ecn = emu::Ecn::kNotEct;
  Address from{};
  // The link of the world and its direction.
  std::uint32_t wire = 0;
  bool up = false;
  // How many cells it has passed.
  std::uint32_t passed = 0;
  // By how much it is delayed behind its link.
  Duration delay{};
};

class Packets {
 public:
  // A tag for a new packet, all of whose fields the caller sets.
  std::uint64_t add() {
    if (free_.empty()) {
      packets_.emplace_back();
      return packets_.size() - 1;
    }
    const std::uint64_t tag = free_.back();
    free_.pop_back();
    return tag;
  }
  std::uint64_t copy(std::uint64_t tag) {
    const std::uint64_t copy = add();
    packets_[copy] = packets_[tag];
    return copy;
  }
  void release(std::uint64_t tag) { free_.push_back(tag); }
  // Valid until the next add() or copy().
  PacketOnItsWay& operator[](std::uint64_t tag) { return packets_[tag]; }
  // How many are on their way.
  std::size_t size() const { return packets_.size() - free_.size(); }

 private:
  std::vector<PacketOnItsWay> packets_;
  std::vector<std::uint64_t> free_;
};

}  // namespace interneuron::sim
