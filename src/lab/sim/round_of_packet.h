// Tells of each packet that one sender puts on its links which round it belongs to: how experiments
// delay the packets of certain rounds. The sender's packets are shown in the order in which they
// leave. The first piece of a message opens with the header of its round, and the pieces of a
// message leave in order, so the later pieces are known by their message.
//
// Remembers every message of the run, some 50 bytes each, which is little for as long as
// experiments take. It trusts the packets, since they come from this very program.
// Thread-compatible; pure.
#pragma once

#include <map>
#include <optional>

#include "interneuron/units.h"

namespace interneuron::sim {

class RoundOfPacket {
 public:
  // The round of a data packet; nothing for other packets and for pieces of messages whose first
  // piece was not shown.
  std::optional<RoundId> of(ByteView datagram);

 private:
  std::map<MessageId, RoundId> rounds_;
};

}  // namespace interneuron::sim
