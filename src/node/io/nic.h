// The network cards (NICs) of this host, as they are now.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/transport.h"

namespace interneuron::io {

// A hardware address of Ethernet.
using Mac = std::array<std::byte, 6>;

// What the kernel says of one NIC.
struct Nic {
  std::string name;
  // The kernel's number of the NIC. A NIC that was unplugged and came back under the same name has
  // another one.
  int index = 0;
  // "ethernet", "wifi", "wwan", "veth", "tun", "loopback", … (docs/links.md).
  std::string kind;
  // Empty when the kernel names none.
  std::string driver;
  // "02:00:00:00:00:01"; empty when it has none.
  std::string mac;
  // The state of RFC 2863 as the kernel says it: "up", "down", "dormant", "unknown", …
  std::string operstate;
  bool admin_up = false;
  bool carrier = false;
  // Administratively up and with carrier.
  bool up = false;
  // The largest packet of the IP layer, bytes.
  std::size_t mtu = 0;
  // Receive queues that its driver has made room for, of which fewer may be in use; at least 1.
  std::uint32_t receive_queues = 1;
  // Its own addresses, and the gateways of the default routes through it: port 0, IPv4 first, in
  // the kernel's order.
  std::vector<Address> addresses;
  std::vector<Address> gateways;
};

// All of this network namespace, in the kernel's order. A program without the part `monitor` (see
// parts.h) has no `gateways`, learns of one receive queue, takes NICs that only software makes for
// "ethernet" unless sysfs knows better, and IPv6 addresses for usable while the kernel still looks
// for duplicates of them. Throws IoError when the system refuses.
std::vector<Nic> list_nics();

// The same for one name; nothing when there is no such NIC.
std::optional<Nic> find_nic(std::string_view name);

// As in Nic::mac; empty for what is no address of Ethernet, or all zeros.
std::string mac_text(std::span<const std::byte> mac);

// The user named a network card, or a pattern of them, that this host does not have. A class of its
// own because programs answer it as they answer any unknown name. Its code is ENODEV.
class UnknownNic : public IoError {
 public:
  explicit UnknownNic(const std::string& what);
};

// "no network card named eth9; there are lo, eth0"
std::string unknown_nic_text(std::string_view name);

}  // namespace interneuron::io
