// What the links of a node want to know of the network cards (NICs) of this network namespace:
// which there are, whether they can be used, and what has changed. LinkMonitor
// (src/node/monitor/) follows the kernel. A program that is linked without it has what
// open_nic_monitor() read when it started: addresses and flags, but neither changes nor routes, so
// that it suits hosts whose cards stay and whose addresses are fixed.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/link.h"
#include "node/io/nic.h"

namespace interneuron::io {

// A change of one NIC's state or of what it is reached at.
struct NicEvent {
  std::string nic;
  // The name that the NIC had, if it was renamed: what was required of that is required of its new
  // name, and there is no event of the old one. Empty otherwise, and where something was required
  // of the new name already: then the old one is absent.
  std::string former_name{};
  // 0 when it is not there any more.
  int index = 0;
  NicState from{};
  NicState to{};
  // The socket must be opened anew: another NIC, another first address, another MTU.
  bool new_incarnation = false;
  // One line: "no carrier", "address 10.0.0.2 is gone", "moved to another network namespace", …
  std::string reason;
};

// Set-up failures throw IoError; what fails later is tried again by the next update().
// Thread-compatible.
class NicMonitor {
 public:
  NicMonitor() = default;
  virtual ~NicMonitor() = default;
  NicMonitor(const NicMonitor&) = delete;
  NicMonitor& operator=(const NicMonitor&) = delete;

  // Readable when the kernel has something to tell: call update() then. -1: it never has.
  virtual int native_handle() const = 0;
  // Reads what has come and says what follows from it: at most one event per NIC, from its state at
  // the last call to that of now. Never waits for events.
  virtual std::vector<NicEvent> update() = 0;

  // By index, loopback too.
  virtual const std::vector<Nic>& nics() const = 0;
  const Nic* find(std::string_view name) const {
    const auto it = std::ranges::find(nics(), name, &Nic::name);
    return it == nics().end() ? nullptr : &*it;
  }
  // kAbsent for a name that is not there.
  virtual NicState state(std::string_view name) const = 0;
  // Why the NIC's state changed the last time, one line.
  virtual std::string_view reason(std::string_view name) const = 0;

  // From now on `name` is ready only if `peer` is routed through it; with an empty `peer`, as soon
  // as it has an address. The state changes at once, without an event. Without this call a NIC is
  // ready if a default route of a family that it has an address of leads through it.
  virtual void require_route(std::string_view name, const Address& peer) = 0;
  // Takes require_route() back.
  virtual void require_nothing(std::string_view name) = 0;
  // The address (port 0) that a socket must be bound to for the required peer to be routed through
  // `name`: where only a rule for the source address ("from 10.0.0.2 lookup 101") does so. Empty
  // when any will do.
  virtual std::optional<Address> required_source(std::string_view name) const = 0;

  // Before a socket is opened on a NIC whose carrier came back; see node/monitor/route_query.h.
  // Does nothing without CAP_NET_ADMIN.
  virtual void drop_unanswered_neighbours(std::string_view name) = 0;
};

// Follows the kernel where the part `monitor` is linked (parts.h), without regard to default
// routes; else it has the NICs of now, ready as soon as they are up and have an address. Throws
// IoError.
std::unique_ptr<NicMonitor> open_nic_monitor();

// The state that a NIC should be in, and why.
struct NicVerdict {
  NicState state{};
  std::string reason;
  // See NicMonitor::required_source().
  std::optional<Address> source{};
};
// By its flags, and by those of its addresses that may be used; routes are not looked at. `peer`:
// whom it is to reach; empty: anybody.
NicVerdict judge_card(const Nic& nic, std::span<const Address> usable,
                      const std::optional<Address>& peer);
// Whether a socket that is to reach `peer` may be bound to the address.
bool is_usable(const Address& address, const std::optional<Address>& peer);

}  // namespace interneuron::io
