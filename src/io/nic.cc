#include "io/nic.h"

#include <ifaddrs.h>
#include <net/if.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

#include "io/address.h"
#include "io/file_descriptor.h"

namespace interneuron::io {

namespace {

std::size_t read_mtu(int fd, const std::string& name) {
  ifreq request{};
  name.copy(request.ifr_name, IFNAMSIZ - 1);
  if (::ioctl(fd, SIOCGIFMTU, &request) != 0 || request.ifr_mtu < 0) return 0;
  return static_cast<std::size_t>(request.ifr_mtu);
}

Nic& entry_of(std::vector<Nic>& nics, const char* name) {
  for (Nic& nic : nics) {
    if (nic.name == name) return nic;
  }
  nics.emplace_back();
  nics.back().name = name;
  return nics.back();
}

}  // namespace

std::vector<Nic> list_nics() {
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) {
    const int error = errno;
    throw IoError(std::string("cannot list the network cards: getifaddrs: ") + std::strerror(error),
                  error);
  }
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> guard(list, &::freeifaddrs);
  const FileDescriptor any(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));

  std::vector<Nic> nics;
  for (const ifaddrs* item = list; item != nullptr; item = item->ifa_next) {
    Nic& nic = entry_of(nics, item->ifa_name);
    nic.up = (item->ifa_flags & IFF_UP) != 0 && (item->ifa_flags & IFF_RUNNING) != 0;
    if (nic.mtu == 0) nic.mtu = read_mtu(any.get(), nic.name);
    if (item->ifa_addr == nullptr) continue;
    const bool ipv6 = item->ifa_addr->sa_family == AF_INET6;
    const Address address =
        from_sockaddr(item->ifa_addr, ipv6 ? sizeof(sockaddr_in6) : sizeof(sockaddr_in));
    if (address.size != 0) nic.addresses.push_back(address);
  }
  for (Nic& nic : nics) {
    std::stable_partition(nic.addresses.begin(), nic.addresses.end(),
                          [](const Address& address) { return !is_ipv6(address); });
  }
  return nics;
}

std::optional<Nic> find_nic(std::string_view name) {
  for (Nic& nic : list_nics()) {
    if (nic.name == name) return std::move(nic);
  }
  return std::nullopt;
}

std::string unknown_nic_text(std::string_view name) {
  std::string text = "no network card named ";
  text += name.empty() ? "\"\"" : name;
  std::string separator = "; there are ";
  for (const Nic& nic : list_nics()) {
    text += separator + nic.name;
    separator = ", ";
  }
  return text;
}

}  // namespace interneuron::io
