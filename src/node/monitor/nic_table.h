// What the kernel says of this namespace's network cards (NICs), as a table that its messages
// (listings and events alike) keep current. Whether a NIC can be used is not decided here but in
// link_monitor.h. The messages are the kernel's; their sizes are checked all the same, and one that
// does not parse is ignored. Size: one entry per NIC, address and default route; departures are
// kept until forget_departures(). Thread-compatible. Errors: read() throws IoError.
#pragma once

#include <linux/netlink.h>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "node/io/nic.h"
#include "node/monitor/netlink.h"

namespace interneuron::io {

class NicTable {
 public:
  // Reads everything anew. Throws IoError when the system refuses.
  void read(nl_sock* requests, bool default_routes);
  // Reads the default routes anew, some of which the kernel removes without an event. False when
  // the kernel refuses.
  bool read_default_routes(nl_sock* requests);
  // The kernel brings a NIC's carrier up to date when it is asked for that NIC (Linux 6.8), while
  // its events may come a second late (MAX_DO_DEV_PER_LOOP and HZ in net/core/link_watch.c).
  void refresh_lagging(nl_sock* requests);

  // Takes an event in; anything else is ignored.
  void apply(const nlmsghdr& message);
  // Takes a route of a listing in; only default routes through NICs that are known count.
  void apply_default_route(const nlmsghdr& message);

  // By index.
  const std::vector<Nic>& nics() const { return nics_; }
  const Nic* find(std::string_view name) const;
  const Nic* find(int index) const;

  // Whether a default route of the family leads through it.
  bool has_default_route(int index, bool ipv6) const;

  // What became of a NIC that vanished, in words; kept until forget_departures() is called.
  std::string_view departure(int index) const;
  void forget_departures() { departures_.clear(); }

 private:
  struct DefaultRoute {
    int index = 0;
    bool ipv6 = false;
    friend auto operator<=>(const DefaultRoute&, const DefaultRoute&) = default;
  };

  Nic* entry(int index);
  void apply_link(const nlmsghdr& message);
  void remove_link(const nlmsghdr& message);
  void apply_address(const nlmsghdr& message);

  // Sorted by index.
  std::vector<Nic> nics_;
  std::vector<DefaultRoute> default_routes_;
  std::map<int, std::string> departures_;
};

}  // namespace interneuron::io
