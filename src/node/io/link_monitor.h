// Watches the network cards (NICs) of this network namespace by the kernel's routing netlink:
// links, addresses, routes and rules, kept current by its events. When events were lost (ENOBUFS),
// everything is read anew.
//
// A NIC's state is derived from a table of what the kernel said last, never from the event itself,
// so that a state is the same whatever the order of events was. Whether the peer is routed is asked
// of the kernel (RTM_GETROUTE): it alone knows its rules, and a socket that is bound to a NIC
// without a route gets no error but an assumption that the peer is on its wire (docs/constants.md,
// "NICs and the kernel").
//
// It does not look at the traffic; src/core/link/ does. Only the kernel, and processes with
// CAP_NET_ADMIN, can send to its sockets. Memory is linear in the number of NICs. Owns two netlink
// sockets. Thread-compatible. Set-up failures throw IoError; what fails later is tried again by the
// next update().
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/link.h"
#include "node/io/nic.h"

namespace interneuron::io {

// A change of one NIC's state or of what it is reached at.
struct NicEvent {
  std::string nic;
  // 0 when it is not there any more.
  int index = 0;
  NicState from{};
  NicState to{};
  // The socket must be opened anew: another NIC, another first address, another MTU.
  bool new_incarnation = false;
  // One line: "no carrier", "address 10.0.0.2 is gone", "moved to another network namespace", …
  std::string reason;
};

class LinkMonitor {
 public:
  struct Options {
    // Of the event socket: room for some thousand events of about 1 KiB each. The kernel grants
    // less to processes without CAP_NET_ADMIN (net.core.rmem_max); events are then lost sooner, and
    // everything is read anew more often.
    std::size_t receive_buffer_bytes = 4 * 1024 * 1024;
    // Reads default routes: Nic::gateways, and the state of NICs without require_route(), which
    // otherwise are ready as soon as they have an address. Kernels before 6.10 may hold up a reader
    // of routes while a NIC is being removed.
    bool default_routes = true;
  };

  LinkMonitor() : LinkMonitor(Options{}) {}
  explicit LinkMonitor(const Options& options);
  ~LinkMonitor();
  LinkMonitor(const LinkMonitor&) = delete;
  LinkMonitor& operator=(const LinkMonitor&) = delete;

  // Readable when the kernel has something to tell: call update() then.
  int native_handle() const;
  // Reads what has come and says what follows from it: at most one event per NIC, from its state at
  // the last call to that of now. Also without anything to read it looks for routes again, because
  // the kernel removes some without a word. Never waits for events.
  std::vector<NicEvent> update();

  // By index, loopback too.
  const std::vector<Nic>& nics() const;
  const Nic* find(std::string_view name) const;
  // kAbsent for a name that is not there.
  NicState state(std::string_view name) const;
  // Why the NIC's state changed the last time, one line.
  std::string_view reason(std::string_view name) const;

  // From now on `name` is ready only if `peer` is routed through it; with an empty `peer`, as soon
  // as it has an address. The state changes at once, without an event. Without this call a NIC is
  // ready if a default route of a family that it has an address of leads through it.
  void require_route(std::string_view name, const Address& peer);
  // Takes require_route() back.
  void require_nothing(std::string_view name);
  // The address (port 0) that a socket must be bound to for the required peer to be routed through
  // `name`: where only a rule for the source address ("from 10.0.0.2 lookup 101") does so. Empty
  // when any will do.
  std::optional<Address> required_source(std::string_view name) const;

  // Before a socket is opened on a NIC whose carrier came back; see node/io/neighbours.h. Does
  // nothing without CAP_NET_ADMIN.
  void drop_unanswered_neighbours(std::string_view name);

  // How many times everything was read anew because events were lost.
  std::uint64_t resyncs() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron::io
