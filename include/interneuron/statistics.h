// What a Node tells of its links: changes of their NICs, and all that is measured. Plain values.
#pragma once

#include <string>
#include <vector>

#include "interneuron/endpoint.h"
#include "interneuron/transport.h"

namespace interneuron {

// What the kernel says of a link's NIC has changed.
struct NicChanged {
  LinkId link{};
  std::string nic;
  NicState from{};
  NicState to{};
  // One line, for people.
  std::string reason;
  // Nothing has changed: the link was opened after the node had started, and `reason` is what
  // Node::warnings() would have had of it.
  bool is_warning = false;
};

// All that is measured, at one instant.
struct Statistics {
  struct Link {
    LinkId id{};
    std::string nic;
    NicState nic_state{};
    // Why the NIC is in this state, one line.
    std::string reason;
    LinkCounters counters;
    TransportCounters transport;
  };
  struct Peer {
    PeerId id{};
    std::vector<LinkState> links;
    // What it holds here, and which limits have struck it.
    PeerLedger ledger;
  };
  TimePoint at{};
  std::vector<Link> links;
  std::vector<Peer> peers;
  EndpointCounters counters;
  // The longest time that one handler, task or continuation of the application kept the loop since
  // run() began. Meanwhile nothing is received and nothing leaves; what computes for longer than a
  // few milliseconds belongs to Node::compute().
  Duration loop_stall{};
};

}  // namespace interneuron
