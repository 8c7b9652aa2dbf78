// What is known of every packet that a probe has sent. Pure values.
#pragma once

#include <cstdint>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::probe {

enum class Purpose : std::uint8_t {
  kPing,     // one of those that are counted
  kTrain,    // back to back with others, for the rate
  kClosing,  // asks the reflector how many have arrived
  kSkipped,  // a sequence number that was left out
};

// One sequence number, the index into the log.
struct SentPacket {
  TimePoint sent{};      // t1
  TimePoint received{};  // t4, of the first reply
  // t2 - t1 and t4 - t3: each with the unknown offset of the two clocks in it, their sum without.
  Duration up{};
  Duration down{};
  std::uint32_t counted = 0;  // the reflector's sequence number
  Purpose purpose = Purpose::kPing;
  bool answered = false;

  Duration rtt() const { return up + down; }
};

using PacketLog = std::vector<SentPacket>;

}  // namespace interneuron::probe
