#include "node/io/nic.h"

#include <ifaddrs.h>
#include <net/if.h>
#include <netpacket/packet.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "node/io/address.h"
#include "node/io/file_descriptor.h"
#include "node/io/nic_choice.h"
#include "node/io/nic_kind.h"
#include "node/io/parts.h"

namespace interneuron::io {

namespace {

struct FreeAddresses {
  void operator()(ifaddrs* list) const { ::freeifaddrs(list); }
};

std::size_t mtu_of(const std::string& name) {
  const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  name.copy(request.ifr_name, IFNAMSIZ - 1);
  if (::ioctl(socket.get(), SIOCGIFMTU, &request) != 0) return 0;
  return static_cast<std::size_t>(std::max(request.ifr_mtu, 0));
}

Nic card_of(const ifaddrs& entry) {
  sockaddr_ll link{};
  std::memcpy(&link, entry.ifa_addr, sizeof link);
  Nic nic;
  nic.name = entry.ifa_name;
  nic.index = link.sll_ifindex;
  nic.mac = mac_text(std::as_bytes(std::span(link.sll_addr))
                         .first(std::min<std::size_t>(link.sll_halen, sizeof link.sll_addr)));
  nic.admin_up = (entry.ifa_flags & IFF_UP) != 0;
  nic.up = nic.admin_up && (entry.ifa_flags & IFF_RUNNING) != 0;
  nic.carrier = nic.up;
  nic.operstate = nic.up ? "up" : "down";
  nic.mtu = mtu_of(nic.name);
  const NicOrigin origin = origin_of(nic, (entry.ifa_flags & IFF_LOOPBACK) != 0, "");
  nic.kind = origin.kind;
  nic.driver = origin.driver;
  return nic;
}

// What the C library says of NICs: first the cards, then the addresses, IPv4 before IPv6.
std::vector<Nic> list_without_monitor() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) {
    throw IoError(
        std::string("cannot list the network cards (getifaddrs: ") + std::strerror(errno) + ")",
        errno);
  }
  const std::unique_ptr<ifaddrs, FreeAddresses> all(first);
  std::vector<Nic> out;
  for (const ifaddrs* entry = first; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr) continue;
    if (entry->ifa_addr->sa_family == AF_PACKET) {
      out.push_back(card_of(*entry));
      continue;
    }
    // An IPv4 address may have a label of its own, "eth0:1".
    const std::string_view label = entry->ifa_name;
    const auto nic = std::ranges::find(out, label.substr(0, label.find(':')), &Nic::name);
    const bool ipv6 = entry->ifa_addr->sa_family == AF_INET6;
    const Address address = from_sockaddr(
        entry->ifa_addr, static_cast<socklen_t>(ipv6 ? sizeof(sockaddr_in6) : sizeof(sockaddr_in)));
    if (nic != out.end() && address.size != 0) nic->addresses.push_back(address);
  }
  return out;
}

}  // namespace

std::vector<Nic> list_nics() {
  const MonitorPart* part = monitor_part();
  return part != nullptr ? part->list_nics() : list_without_monitor();
}

std::optional<Nic> find_nic(std::string_view name) {
  for (Nic& nic : list_nics()) {
    if (nic.name == name) return std::move(nic);
  }
  return std::nullopt;
}

std::string mac_text(std::span<const std::byte> mac) {
  if (mac.size() != Mac{}.size()) return {};
  if (std::ranges::all_of(mac, [](std::byte b) { return b == std::byte{}; })) return {};
  std::string text;
  for (const std::byte b : mac) {
    std::array<char, 4> part{};
    std::snprintf(part.data(), part.size(), text.empty() ? "%02x" : ":%02x",
                  std::to_integer<unsigned>(b));
    text += part.data();
  }
  return text;
}

UnknownNic::UnknownNic(const std::string& what) : IoError(what, ENODEV) {}

std::string unknown_nic_text(std::string_view name) { return no_match_text(name, list_nics()); }

}  // namespace interneuron::io
