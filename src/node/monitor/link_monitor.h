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
#include <string_view>
#include <vector>

#include "node/io/nic_monitor.h"

namespace interneuron::io {

class LinkMonitor final : public NicMonitor {
 public:
  struct Options {
    // The buffer of the event socket: room for some thousand events of about 1 KiB each. The kernel
    // grants less to processes without CAP_NET_ADMIN (net.core.rmem_max); events are then lost
    // sooner, and everything is read anew more often.
    std::size_t receive_buffer_bytes = 4 * 1024 * 1024;
    // Reads default routes: Nic::gateways, and the state of NICs without require_route(), which
    // otherwise are ready as soon as they have an address. Kernels before 6.10 may hold up a reader
    // of routes while a NIC is being removed.
    bool default_routes = true;
  };

  LinkMonitor() : LinkMonitor(Options{}) {}
  explicit LinkMonitor(const Options& options);
  ~LinkMonitor() override;

  int native_handle() const override;
  // Also without anything to read it looks for routes again, because the kernel removes some
  // without a word.
  std::vector<NicEvent> update() override;
  const std::vector<Nic>& nics() const override;
  NicState state(std::string_view name) const override;
  std::string_view reason(std::string_view name) const override;
  void require_route(std::string_view name, const Address& peer) override;
  void require_nothing(std::string_view name) override;
  std::optional<Address> required_source(std::string_view name) const override;
  void drop_unanswered_neighbours(std::string_view name) override;

  // How many times everything was read anew because events were lost.
  std::uint64_t resyncs() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron::io
