// What messages of the kernel's routing netlink say, read with every length checked: fixed headers,
// attributes and, of routes and neighbours, what this folder wants to know. An attribute that is
// shorter than what it should hold, and text without an end, count as absent: libnl's own getters
// would read what lies behind them.
//
// The messages are the kernel's, which is trusted, but its versions differ in what they send, and a
// namespace's owner may have what a driver says under control. No sockets here, so that any bytes
// can be tried. Views are valid as long as the message is. Thread-safe; never throws.
#pragma once

#include <linux/netlink.h>
#include <netlink/attr.h>
#include <netlink/msg.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "interneuron/address.h"
#include "node/io/nic.h"

namespace interneuron::io::netlink {

// The fixed header of a message; nullptr when the message is too short for it.
template <class Header>
const Header* header_of(const nlmsghdr& message) {
  if (message.nlmsg_len < NLMSG_LENGTH(sizeof(Header))) return nullptr;
  return static_cast<const Header*>(NLMSG_DATA(&message));
}

// The attributes that follow a fixed header, indexed by their type up to `Most`; nothing when the
// message is too short for the header or its attributes do not add up.
template <class Header, std::size_t Most>
std::optional<std::array<nlattr*, Most + 1>> attributes_of(const nlmsghdr& message) {
  std::array<nlattr*, Most + 1> out{};
  if (header_of<Header>(message) == nullptr ||
      nlmsg_parse(const_cast<nlmsghdr*>(&message), sizeof(Header), out.data(),
                  static_cast<int>(Most), nullptr) < 0) {
    return std::nullopt;
  }
  return out;
}

// What an attribute holds; empty when there is none.
std::span<const std::byte> bytes_of(const nlattr* attribute);
// Up to its end or to the first zero; empty when there is none.
std::string text_of(const nlattr* attribute);
// A number of this type; nothing when there is none, or too few bytes for one.
template <class Number>
std::optional<Number> number_of(const nlattr* attribute) {
  const auto bytes = bytes_of(attribute);
  Number value{};
  if (bytes.size() < sizeof value) return std::nullopt;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

// The address that these bare bytes are, with port 0; empty when they are neither of IPv4 nor of
// IPv6. A link-local address means nothing without its card, the one with this index.
interneuron::Address address_of(std::span<const std::byte> host, int index);

// The reverse of address_of(): the bytes of the bare address.
std::span<const std::byte> host_bytes(const interneuron::Address& address);
// Adds it to a message as an attribute; negative, an error of libnl, where there is no room.
int put(nl_msg* message, int type, const interneuron::Address& address);

// A route as the answer to "which way to this address through this card?"
struct RouteAnswer {
  // The gateway; empty when there is none.
  interneuron::Address gateway{};
  // The address to send from; empty when the route names none.
  interneuron::Address source{};
};
// Nothing when the message is no route through the card with this index, or one that drops.
std::optional<RouteAnswer> route_answer(const nlmsghdr& message, int index);

// One hop of a route.
struct RouteHop {
  int card = 0;
  // RTNH_F_DEAD, …
  unsigned flags = 0;
  // Empty when there is none.
  interneuron::Address gateway{};
};
// The hops of a route; none when the message is no route, names no card, or does not add up.
// libnl's own reader is not used: hops of length 0, without their padding, or with a gateway of one
// byte make it read beyond the message, the first of them for ever.
std::vector<RouteHop> hops_of(const nlmsghdr& message);

// Whether the message is a route (of one or several hops) that leads through the card with this
// index.
bool leads_through(const nlmsghdr& message, int index);

// Whether a change of routes concerns a default route.
bool is_default_route(const nlmsghdr& message);

// A neighbour as the kernel knows it.
struct Neighbour {
  int card = 0;
  // NUD_REACHABLE, …
  std::uint16_t state = 0;
  // Its bare address; not empty.
  std::span<const std::byte> address{};
  // Nothing where it is not known, or no address of Ethernet.
  std::optional<Mac> mac{};
};
// Nothing when the message is none, or names no address.
std::optional<Neighbour> neighbour(const nlmsghdr& message);

// The card that a change of a card or of an address is about; nothing for any other message, and
// for those by which bridges tell of their ports.
std::optional<int> card_of(const nlmsghdr& message);

}  // namespace interneuron::io::netlink
