// The words of a World: its hosts, links and cells by number, the clock of a host, hosts that do
// not speak Interneuron, the packets that are on their way, and what may go wrong on a link beside
// what emulated links do. Pure; thread-compatible; no errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/round.h"
#include "interneuron/time.h"
#include "interneuron/units.h"
#include "lab/emu/queue.h"

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

// How far a host's clock of the simulation is from the world's. It shows offset + t + t * drift at
// world time t. In reality the offsets of two hosts may differ by any amount, and quartz drifts by
// some 20 ppm. A plain value; pure.
struct ClockError {
  Duration offset{};
  std::int64_t drift_ppm = 0;

  // What the clock shows at world time `t`.
  TimePoint local(Duration t) const;
  // The first instant of world time at which the clock has reached `t`.
  Duration world(TimePoint t) const;
};

using emu::Ecn;

struct ForeignPacket {
  LinkId link{};
  // Whom it goes to when it is polled, who sent it when it is handled: World::address_of().
  Address peer{};
  // What it weighs on links and in queues, with all its headers, whatever `bytes` holds.
  std::size_t ip_bytes = 0;
  Ecn ecn = Ecn::kNotEct;
  // What the two ends tell each other. It need not be as long as the real packet would be.
  Bytes bytes;
};

// A host of the simulation that does not speak Interneuron: cross traffic, and the transports that
// Interneuron is compared with. A World drives it as it drives an Endpoint: inputs by call, outputs
// by poll, time as an argument. Its clock is the world's, without error. The World owns it. Packets
// come from a host of this very program, so what they hold is trusted.
class ForeignHost {
 public:
  virtual ~ForeignHost() = default;
  // A packet has arrived. `now` never goes back, here and below.
  virtual void handle_packet(Duration now, const ForeignPacket& packet) = 0;
  // The instant of next_timeout() has come. Early and spurious calls are harmless.
  virtual void handle_timeout(Duration now) = 0;
  // The next packet that leaves now, if any. Asked again after each call above, and after
  // World::flush(), until there is none.
  virtual std::optional<ForeignPacket> poll_transmit(Duration now) = 0;
  // When handle_timeout() or poll_transmit() has something to do; nothing: not before a packet.
  virtual std::optional<Duration> next_timeout(Duration now) const = 0;
};

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

// The packets of a World that are on their way, by tag: the handle that emulated links and cells
// keep of them. A released packet keeps its memory for the next one, so that nothing is allocated
// in the steady state. No bound of its own: what links and cells hold bounds it.
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
