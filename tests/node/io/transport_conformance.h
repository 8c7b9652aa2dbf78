// What the two conformance suites share: two hosts with a transport of a chosen kind each. A new
// kind of transport joins both suites by its place in all_kinds().
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "node/io/open_transport.h"
#include "node/io/steady_clock.h"
#include "support.h"
#include "two_hosts.h"

namespace interneuron::io {

using Kind = TransportKind;

inline std::unique_ptr<Transport> make(Kind kind, const UdpOptions& options) {
  return open_transport(kind, options).transport;
}

inline bool may_use_xdp() {
  try {
    require_privilege(Kind::kXdp);
    return true;
  } catch (const IoError&) {
    return false;
  }
}

// Runs a test in a namespace with the privileges of the host, which XDP needs.
inline void as_root(const std::function<void()>& body) {
  if (!may_use_xdp()) GTEST_SKIP() << "needs root of the host, for XDP";
  in_namespace(body, Root::kOfHost);
}

// The kinds of the transports here and there.
using Kinds = std::tuple<Kind, Kind>;

// Two hosts, each with a transport.
struct Pair {
  TwoHosts hosts;
  std::unique_ptr<Transport> here;
  std::unique_ptr<Transport> there;
  Address to_there;
  Address to_here;

  // False when this machine cannot do it.
  bool open(const Kinds& kinds, bool ipv6 = false) {
    if (!hosts.made()) return false;
    // A NIC that has just come up answers no neighbour of IPv6 for up to a second.
    if (ipv6 && !hosts.meet()) return false;
    const auto [kind_here, kind_there] = kinds;
    here = make(kind_here, TwoHosts::options("va", ipv6 ? "fd99::1" : "10.99.0.1"));
    there = hosts.there([&, kind = kind_there] {
      return make(kind, TwoHosts::options("vb", ipv6 ? "fd99::2" : "10.99.0.2"));
    });
    to_there = there->local_address();
    to_here = here->local_address();
    return true;
  }
};

// Offers again what is refused, as an Outbox does, until all is taken and nothing is held.
inline bool send_all(Transport& transport, std::span<const Outgoing> batch) {
  const TimePoint end = now() + kPatience;
  BatchResult result;
  do {
    result = transport.send(batch);
    if (result.gone != 0) return false;
    batch = batch.subspan(result.taken);
    if (result.would_block) wait_for(transport, POLLOUT);
  } while ((!batch.empty() || result.refused) && now() < end);
  return batch.empty() && !result.refused;
}

inline bool send_all(Transport& transport, const Address& to, const std::vector<Bytes>& payloads) {
  return send_all(transport, to_all(to, payloads));
}

// Whether something can be received within so many milliseconds.
inline bool readable(const Transport& transport, int milliseconds) {
  pollfd item{.fd = transport.native_handle(), .events = POLLIN, .revents = 0};
  return ::poll(&item, 1, milliseconds) == 1;
}

// Who sent the next `count` datagrams; fewer when they do not come.
inline std::vector<Address> senders(Transport& transport, std::size_t count) {
  std::vector<Address> out;
  while (out.size() < count && wait_for(transport, POLLIN)) {
    for (const Incoming& datagram : transport.receive()) out.push_back(datagram.from);
  }
  out.resize(count);
  return out;
}

// Sends a datagram again and again until one arrives; false when none does.
inline bool gets_through(Transport& sender, const Address& to, Transport& receiver) {
  const TimePoint end = now() + kPatience;
  const Bytes bytes = payload(99, 100);
  while (now() < end) {
    sender.send(to_all(to, {bytes}));
    if (readable(receiver, 10) && !receiver.receive().empty()) return true;
  }
  return false;
}

class TransportConformance : public testing::TestWithParam<Kinds> {
 protected:
  // Runs a test in a namespace, with the privileges that these transports need.
  static void run_alone(const std::function<void()>& body) {
    const auto [here, there] = GetParam();
    const bool has_xdp = here == Kind::kXdp || there == Kind::kXdp;
    if (has_xdp && !may_use_xdp()) GTEST_SKIP() << "needs root of the host, for XDP";
    in_namespace(body, has_xdp ? Root::kOfHost : Root::kOfNamespace);
  }
  // The same with both transports.
  static void run(const std::function<void(Pair&)>& body, bool ipv6 = false) {
    run_alone([&] {
      Pair pair;
      if (!pair.open(GetParam(), ipv6)) GTEST_SKIP();
      body(pair);
    });
  }
};

// "UdpToRing"
inline std::string name_of(const Kinds& kinds) {
  const auto name = [](Kind kind) {
    return kind == Kind::kUdp ? "Udp" : kind == Kind::kRing ? "Ring" : "Xdp";
  };
  return std::string(name(std::get<0>(kinds))) + "To" + name(std::get<1>(kinds));
}

// Each combination of sender and receiver.
inline auto all_kinds() {
  const auto each = testing::Values(Kind::kUdp, Kind::kRing, Kind::kXdp);
  return testing::Combine(each, each);
}

}  // namespace interneuron::io
