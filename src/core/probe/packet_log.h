// What is known of every packet that a Measurement has sent: it writes the log, Summary and the
// trains' rates read it. Pure values.
#pragma once

#include <cstdint>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::probe {

enum class Purpose : std::uint8_t {
  // Counted in losses and round trips.
  kPing,
  // Sent back to back with others, to tell the rate.
  kTrain,
  // Sent after the last ping: its reply tells how many packets the reflector has received.
  kClosing,
  // A sequence number that no packet carried. A stateless reflector repeats the requests' numbers
  // and so shows this gap; a stateful one numbers its replies without it.
  kSkipped,
};

// One packet. Its sequence number on the wire is its index into the log. t1 … t4 are the four
// instants of an exchange: sent, received by the reflector, sent back, received here.
struct SentPacket {
  // t1.
  TimePoint sent{};
  // t4, of the first reply.
  TimePoint received{};
  // t2 - t1 and t4 - t3. Each contains the unknown offset of the two clocks; their sum does not.
  Duration up{};
  Duration down{};
  // The sequence number that the reflector gave to its reply.
  std::uint32_t counted = 0;
  Purpose purpose = Purpose::kPing;
  bool answered = false;

  Duration rtt() const { return up + down; }
};

using PacketLog = std::vector<SentPacket>;

}  // namespace interneuron::probe
