// From NodeOptions to what a node is made of. Throws IoError, or std::invalid_argument naming the
// option.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "interneuron/node.h"

namespace interneuron {

// Refuses what cannot work before anything is opened.
void check_options(const NodeOptions& options);

// A random session id and the options that the endpoint shares with the node.
EndpointOptions endpoint_options(const NodeOptions& options);

struct OpenedLink {
  std::unique_ptr<Transport> transport;
  LinkInfo info;
  std::vector<std::string> warnings;
};
// Opens the socket of one link. Refuses public addresses as NodeOptions::insecure says.
OpenedLink open_link(const NodeOptions& options, const NodeLink& link);

}  // namespace interneuron
