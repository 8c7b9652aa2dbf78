// Checks NodeOptions and makes what a node consists of: the endpoint's options and the sockets of
// links. Keeps no state. Throws IoError, or std::invalid_argument that names the option.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/node.h"
#include "node/io/nic.h"

namespace interneuron {

// Refuses what cannot work before anything is opened.
void check_options(const NodeOptions& options);

// Refuses a public address of a peer where packets are in the clear.
void check_peer_address(const NodeOptions& options, const Address& peer);

// A random session id and the options that the endpoint shares with the node; of its keys the seed
// and the time where the caller has given none. Throws IoError where there are no random bytes.
EndpointOptions endpoint_options(const NodeOptions& options);

// Refuses addresses that cannot be, or that may not serve in the clear (NodeOptions::insecure),
// whatever the NIC's state.
void check_link(const NodeOptions& options, const NodeLink& link, const io::Nic& nic);

struct OpenedLink {
  std::unique_ptr<Transport> transport;
  LinkInfo info;
  std::vector<std::string> warnings;
};
struct Binding {
  std::uint16_t port = 0;
  // The address to bind where NodeLink::local_address says nothing.
  std::optional<Address> source{};
  // Not within the loop (io::UdpOptions).
  bool may_wait = true;
};
// Opens the socket of one link. If the port is taken and the options name none, it gets another.
OpenedLink open_link(const NodeOptions& options, const NodeLink& link, const io::Nic& nic,
                     const Binding& binding);

// Whether a socket that is bound to `local` may go on after the NIC's addresses changed.
bool still_fits(const NodeOptions& options, const NodeLink& link, const Address& local,
                const io::Nic& nic);

}  // namespace interneuron
