// A host of the simulation that does not speak Interneuron: cross traffic, and the transports that
// Interneuron is compared with. A World drives it as it drives an Endpoint: inputs by call, outputs
// by poll, time as an argument. Its clock is the world's, without error.
//
// Pure; thread-compatible; the World owns it. Errors: none; packets come from a host of this very
// program, so what they hold is trusted.
#pragma once

#include <cstddef>
#include <optional>

#include "interneuron/address.h"
#include "interneuron/units.h"
#include "lab/emu/ecn.h"

namespace interneuron::sim {

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

}  // namespace interneuron::sim
