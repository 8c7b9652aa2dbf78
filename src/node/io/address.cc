#include "node/io/address.h"

#include <arpa/inet.h>
#include <net/if.h>

#include <charconv>
#include <cstddef>
#include <cstring>

namespace interneuron {

namespace {

// The text inside an address without port is at most "ffff:…:255.255.255.255%interface".
constexpr std::size_t kMaxHostChars = INET6_ADDRSTRLEN + IF_NAMESIZE;

template <class SockAddr>
Address pack(const SockAddr& source) {
  Address out;
  std::memcpy(out.raw.data(), &source, sizeof source);
  out.size = sizeof source;
  return out;
}

template <class SockAddr>
SockAddr unpack(const Address& address) {
  SockAddr out{};
  std::memcpy(&out, address.raw.data(), sizeof out);
  return out;
}

std::uint32_t ipv4_of(const Address& address) {
  return ntohl(unpack<sockaddr_in>(address).sin_addr.s_addr);
}

in6_addr ipv6_of(const Address& address) { return unpack<sockaddr_in6>(address).sin6_addr; }

constexpr bool in_net(std::uint32_t ip, std::uint32_t net, int bits) {
  return ((ip ^ net) >> (32 - bits)) == 0;
}

// The index of the NIC in "%eth0" or "%3" behind a link-local address; 0 when there is no such NIC.
std::uint32_t scope_of(const std::string& zone) {
  std::uint32_t number = 0;
  const char* end = zone.data() + zone.size();
  const auto [stop, error] = std::from_chars(zone.data(), end, number);
  if (error == std::errc{} && stop == end) return number;
  return if_nametoindex(zone.c_str());
}

std::optional<Address> make_ipv6(std::string host, std::uint16_t port) {
  sockaddr_in6 ipv6{};
  ipv6.sin6_family = AF_INET6;
  ipv6.sin6_port = htons(port);
  if (const auto percent = host.find('%'); percent != std::string::npos) {
    ipv6.sin6_scope_id = scope_of(host.substr(percent + 1));
    if (ipv6.sin6_scope_id == 0) return std::nullopt;
    host.resize(percent);
  }
  if (inet_pton(AF_INET6, host.c_str(), &ipv6.sin6_addr) != 1) return std::nullopt;
  return pack(ipv6);
}

}  // namespace

namespace io {

int family_of(const Address& address) {
  if (address.size == sizeof(sockaddr_in)) return AF_INET;
  if (address.size == sizeof(sockaddr_in6)) return AF_INET6;
  return AF_UNSPEC;
}

Address with_port(const Address& address, std::uint16_t port) {
  // sockaddr_in and sockaddr_in6 have the port at the same place.
  static_assert(offsetof(sockaddr_in, sin_port) == offsetof(sockaddr_in6, sin6_port));
  Address out = address;
  const std::uint16_t value = htons(port);
  std::memcpy(&out.raw[offsetof(sockaddr_in, sin_port)], &value, sizeof value);
  return out;
}

std::string host_text(const Address& address) {
  const std::string text = to_string(address);
  const std::string host = text.substr(0, text.rfind(':'));
  return host.starts_with('[') ? host.substr(1, host.size() - 2) : host;
}

Address from_sockaddr(const sockaddr* source, socklen_t size) {
  if (source->sa_family == AF_INET && size >= sizeof(sockaddr_in)) {
    sockaddr_in ipv4{};
    std::memcpy(&ipv4, source, sizeof ipv4);
    std::memset(ipv4.sin_zero, 0, sizeof ipv4.sin_zero);
    return pack(ipv4);
  }
  if (source->sa_family == AF_INET6 && size >= sizeof(sockaddr_in6)) {
    sockaddr_in6 ipv6{};
    std::memcpy(&ipv6, source, sizeof ipv6);
    ipv6.sin6_flowinfo = 0;
    return pack(ipv6);
  }
  return {};
}

}  // namespace io

std::optional<Address> make_address(std::string_view host, std::uint16_t port) {
  if (host.empty() || host.size() > kMaxHostChars) return std::nullopt;
  const std::string text(host);
  sockaddr_in ipv4{};
  if (inet_pton(AF_INET, text.c_str(), &ipv4.sin_addr) == 1) {
    ipv4.sin_family = AF_INET;
    ipv4.sin_port = htons(port);
    return pack(ipv4);
  }
  return make_ipv6(text, port);
}

std::optional<Address> parse_address(std::string_view text) {
  const auto colon = text.rfind(':');
  if (colon == std::string_view::npos) return std::nullopt;
  std::string_view host = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  std::uint16_t port = 0;
  const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc{} || stop != digits.data() + digits.size()) return std::nullopt;
  const bool brackets = host.size() >= 2 && host.front() == '[' && host.back() == ']';
  if (brackets) host = host.substr(1, host.size() - 2);
  if (brackets != (host.find(':') != std::string_view::npos)) return std::nullopt;
  return make_address(host, port);
}

std::string to_string(const Address& address) {
  std::array<char, INET6_ADDRSTRLEN> host{};
  const std::string port = std::to_string(port_of(address));
  switch (io::family_of(address)) {
    case AF_INET: {
      const auto ipv4 = unpack<sockaddr_in>(address);
      inet_ntop(AF_INET, &ipv4.sin_addr, host.data(), host.size());
      return std::string(host.data()) + ":" + port;
    }
    case AF_INET6: {
      const auto ipv6 = unpack<sockaddr_in6>(address);
      inet_ntop(AF_INET6, &ipv6.sin6_addr, host.data(), host.size());
      std::string text = "[";
      text += host.data();
      if (ipv6.sin6_scope_id != 0) {
        std::array<char, IF_NAMESIZE> name{};
        const bool known = if_indextoname(ipv6.sin6_scope_id, name.data()) != nullptr;
        text += '%';
        text += known ? std::string(name.data()) : std::to_string(ipv6.sin6_scope_id);
      }
      return text + "]:" + port;
    }
    default:
      return "?";
  }
}

std::uint16_t port_of(const Address& address) {
  switch (io::family_of(address)) {
    case AF_INET:
      return ntohs(unpack<sockaddr_in>(address).sin_port);
    case AF_INET6:
      return ntohs(unpack<sockaddr_in6>(address).sin6_port);
    default:
      return 0;
  }
}

bool is_ipv6(const Address& address) { return io::family_of(address) == AF_INET6; }

bool is_unspecified(const Address& address) {
  if (is_ipv6(address)) {
    const in6_addr ip = ipv6_of(address);
    return IN6_IS_ADDR_UNSPECIFIED(&ip);
  }
  return io::family_of(address) == AF_INET && ipv4_of(address) == 0;
}

bool is_loopback(const Address& address) {
  if (is_ipv6(address)) {
    const in6_addr ip = ipv6_of(address);
    return IN6_IS_ADDR_LOOPBACK(&ip);
  }
  return io::family_of(address) == AF_INET && in_net(ipv4_of(address), 0x7f000000, 8);
}

bool is_link_local(const Address& address) {
  if (is_ipv6(address)) {
    const in6_addr ip = ipv6_of(address);
    return IN6_IS_ADDR_LINKLOCAL(&ip);
  }
  return io::family_of(address) == AF_INET && in_net(ipv4_of(address), 0xa9fe0000, 16);
}

bool is_private(const Address& address) {
  if (is_loopback(address) || is_link_local(address)) return true;
  if (is_ipv6(address)) return (ipv6_of(address).s6_addr[0] & 0xfe) == 0xfc;
  if (io::family_of(address) != AF_INET) return false;
  const std::uint32_t ip = ipv4_of(address);
  return in_net(ip, 0x0a000000, 8) || in_net(ip, 0xac100000, 12) || in_net(ip, 0xc0a80000, 16);
}

}  // namespace interneuron
