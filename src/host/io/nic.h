// The network cards (NICs) of this host, as they are now.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/transport.h"

namespace interneuron::io {

struct Nic {
  std::string name;
  int index = 0;       // another one = another incarnation of the NIC
  std::string kind;    // "ethernet", "wifi", "wwan", "veth", "tun", "loopback", … (docs/links.md)
  std::string driver;  // empty: the kernel names none
  std::string mac;     // "02:00:00:00:00:01", empty: none
  std::string operstate;  // RFC 2863 as the kernel says it: "up", "down", "dormant", "unknown", …
  bool admin_up = false;
  bool carrier = false;
  bool up = false;                 // administratively up and with carrier
  std::size_t mtu = 0;             // of the IP layer, bytes
  std::vector<Address> addresses;  // port 0; IPv4 first, in the kernel's order
  std::vector<Address> gateways;   // of the default routes through it, port 0; IPv4 first
};

// In the kernel's order. Throws IoError when the system refuses.
std::vector<Nic> list_nics();

std::optional<Nic> find_nic(std::string_view name);

// "no network card named eth9; there are lo, eth0"
std::string unknown_nic_text(std::string_view name);

}  // namespace interneuron::io
