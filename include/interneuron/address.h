// Socket addresses as values: what a peer is reached at on one link. The core stores and compares
// them and never looks inside; the host writes a sockaddr_in or sockaddr_in6 into them. Numeric
// only: names are not resolved. Pure and thread-compatible; text that is no address gives nothing,
// never an exception.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace interneuron {

// The bytes of a sockaddr, of which the first `size` count; 28 bytes hold a sockaddr_in6. An
// Address of size 0 is empty.
struct Address {
  std::array<std::byte, 28> raw{};
  std::uint8_t size = 0;
  friend bool operator==(const Address&, const Address&) = default;
};

// "10.0.0.2:47000", "[::1]:47000" or "[fe80::1%eth0]:47000". Nothing when it is not exactly that;
// port 0 … 65535.
std::optional<Address> parse_address(std::string_view text);
// The same from host and port: "10.0.0.2", "fe80::1%eth0" (no brackets).
std::optional<Address> make_address(std::string_view host, std::uint16_t port);
// The inverse of parse_address(); "?" for an address that is neither IPv4 nor IPv6.
std::string to_string(const Address& address);
// 0 for an address that is neither IPv4 nor IPv6.
std::uint16_t port_of(const Address& address);
bool is_ipv6(const Address& address);
// 0.0.0.0 and ::.
bool is_unspecified(const Address& address);
// 127/8 and ::1.
bool is_loopback(const Address& address);
// 169.254/16 and fe80::/10.
bool is_link_local(const Address& address);
// Not reachable from the public Internet: loopback, link-local, RFC 1918 (10/8, 172.16/12,
// 192.168/16), RFC 4193 (fc00::/7).
bool is_private(const Address& address);

}  // namespace interneuron
