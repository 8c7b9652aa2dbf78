// Where a frame to a peer goes that leaves by one NIC: the address that it is from, and the
// hardware address of the peer or of the gateway to it, as the routes, rules and neighbours of this
// network namespace say. For a transport that writes Ethernet headers itself.
//
// The kernel is asked (routing netlink) when a peer is new and after changes: it tells of changes
// of neighbours, routes, addresses and devices, which are looked at every kEventInterval. What is
// known is asked anew every kRefresh, should an event have been lost. The kernel is also told that
// a neighbour is in use, or it would never verify the neighbour again, nor ask for one that it does
// not know: by routing netlink (NTF_USE) with CAP_NET_ADMIN, else by an empty datagram to the
// discard port (RFC 863) of the neighbour, which makes the kernel ask.
//
// What strangers can do: whoever is on the same link may answer the kernel's questions falsely, as
// ever (RFC 4861 §11.1). Peers come and go by what strangers send, so at most kMost of them are
// kept; then all are asked for anew. A question takes tens of microseconds, but waits while
// somebody else reconfigures the network.
//
// Owns its netlink sockets. Errors: the constructor throws IoError; later on what cannot be asked
// is a peer that cannot be reached. Thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>

#include "interneuron/time.h"
#include "node/io/nic.h"
#include "node/monitor/netlink.h"
#include "node/ring/frame.h"

namespace interneuron::io {

class NextHops {
 public:
  // How often events are looked at while no answer is awaited. No measurement behind this value: it
  // is well below the time in which a peer that moved would be missed, and a look takes
  // microseconds, which would count if it were as frequent as datagrams.
  static constexpr Duration kEventInterval = std::chrono::milliseconds(10);
  // How often what is known is asked anew, and how often at most a neighbour is asked for, unless
  // the NIC has changed: the kernel repeats its questions as often (RFC 4861 §10, RETRANS_TIMER).
  static constexpr Duration kRefresh = std::chrono::seconds(1);
  // How long after each question a peer without a hardware address is waited for; else it counts as
  // unreachable. No measurement behind this value: a neighbour on a loaded radio link answers
  // within it.
  static constexpr Duration kPatience = std::chrono::milliseconds(200);
  static constexpr std::size_t kMost = 1024;

  // The NIC with this index. `has_neighbours`: frames have hardware addresses and these are asked
  // for. `helper`: a UDP socket bound to the NIC, for questions without CAP_NET_ADMIN; not owned.
  NextHops(int index, bool has_neighbours, int helper);

  enum class State : std::uint8_t {
    kKnown,
    // The kernel is asking; the answer is not there yet.
    kAsking,
    // No route, no answer.
    kUnreachable,
  };
  struct Hop {
    State state = State::kUnreachable;
    // The address to send from, port 0; the one that was wished for if there was one.
    Address source{};
    Mac mac{};
  };
  // The way to a peer. `source`: the address to send from, empty: as the route says.
  Hop find(const Address& to, const Address& source, TimePoint now);

  // What has changed since the last call that concerns the NIC itself; what concerns peers is
  // followed without it.
  struct Changes {
    // Its addresses, its MTU or its hardware address.
    bool card = false;
    bool gone = false;
  };
  Changes take_events(TimePoint now);
  // The NIC as it is now; nothing when it is gone or the kernel does not tell. Asks in the network
  // namespace that this object was made in, whichever the thread is in.
  std::optional<Nic> read_card();

 private:
  using Host = std::array<std::byte, 16>;
  // The bare addresses of peer and source; zeros where there is none.
  using Key = std::pair<Host, Host>;
  struct Entry {
    bool routed = false;
    Address source{};
    // The neighbour: the gateway, or the peer itself.
    Address neighbour{};
    bool resolved = false;
    Mac mac{};
    TimePoint looked_up = TimePoint::min();
    // When the hardware address was asked for last.
    std::optional<TimePoint> asked{};
    bool stale = true;
  };

  void look_up(const Address& to, const Address& source, TimePoint now, Entry& entry);
  bool read_route(const Address& to, const Address& source, Entry& entry);
  // The state of the neighbour as the kernel says it (NUD_REACHABLE, …); 0: not known.
  std::uint16_t read_neighbour(Entry& entry);
  void ask_for(const Address& neighbour);
  void apply(const nlmsghdr& message, Changes& changes);

  int index_;
  bool has_neighbours_;
  int helper_;
  netlink::Socket requests_;
  netlink::Socket events_;
  TimePoint next_look_ = TimePoint::min();
  std::map<Key, Entry> entries_;
};

}  // namespace interneuron::io
