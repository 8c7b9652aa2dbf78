// Messages with deadlines over foreign transports: what an application hands to a source, and what
// comes out of a sink. Both are hosts of a sim::World, which owns them; who made them keeps a
// pointer to hand messages over and to ask for what has arrived. Plain values and interfaces; pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "lab/sim/foreign_host.h"

namespace interneuron::foreign {

// Names a source at the sink; the one who makes the source chooses it.
using ConnectionId = std::uint32_t;

struct Message {
  // Names it at the sink.
  std::uint32_t number = 0;
  std::uint64_t bytes = 0;
  // After this it is of no use to anybody.
  Duration deadline = Duration::max();
};

// As much as a run of any length can send: cross traffic with unlimited demand is one such message.
inline constexpr std::uint64_t kUnlimitedBytes = std::uint64_t{1} << 60U;

// A message that is there whole.
struct Arrival {
  ConnectionId connection = 0;
  std::uint32_t number = 0;
  Duration at{};
};

class MessageSource : public sim::ForeignHost {
 public:
  // Takes a message. World::flush() must follow.
  virtual void send(Duration now, const Message& message) = 0;
};

class MessageSink : public sim::ForeignHost {
 public:
  // The next message that has arrived, in the order of arrival.
  virtual std::optional<Arrival> poll_arrival() = 0;
  // Payload of this connection that the application could read by now, whole messages or not.
  virtual std::uint64_t readable_bytes(ConnectionId connection) const = 0;
};

}  // namespace interneuron::foreign
