// The links of a node: what its options say of them, checked; on which NICs they are, whether those
// can be used, and their sockets. What fails throws IoError, or std::invalid_argument that names
// the option.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/node.h"
#include "node/io/nic.h"
#include "node/io/nic_monitor.h"

namespace interneuron {

// Refuses what cannot work before anything is opened.
void check_options(const NodeOptions& options);

// Refuses a public address of a peer where packets are in the clear.
void check_peer_address(const NodeOptions& options, const Address& peer);

// A random session id and the options that the endpoint shares with the node; of its keys the seed
// and the time where the caller has given none. Throws IoError where there are no random bytes.
EndpointOptions endpoint_options(const NodeOptions& options);

// Refuses addresses that cannot be, or that may not serve in the clear (NodeOptions::insecure),
// whatever the NIC's state.
void check_link(const NodeOptions& options, const NodeLink& link, const io::Nic& nic);

struct OpenedLink {
  std::unique_ptr<Transport> transport;
  // Those of the shards, where there are several (NodeOptions::shards).
  std::vector<std::unique_ptr<Transport>> siblings;
  LinkInfo info;
  std::vector<std::string> warnings;
};
struct Binding {
  std::uint16_t port = 0;
  // The address to bind where NodeLink::local_address says nothing.
  std::optional<Address> source{};
  // Not within the loop (io::UdpOptions).
  bool may_wait = true;
};
// Opens the socket of one link. If the port is taken and the options name none, it gets another.
OpenedLink open_link(const NodeOptions& options, const NodeLink& link, const io::Nic& nic,
                     const Binding& binding);

// Whether a socket that is bound to `local` may go on after the NIC's addresses changed.
bool still_fits(const NodeOptions& options, const NodeLink& link, const Address& local,
                const io::Nic& nic);

// A card whose carrier came back is left alone for so long: the other end attaches its queue a few
// milliseconds after ours, plugs bounce, and an ARP request that is lost is repeated only after a
// second (net.ipv4.neigh.*.retrans_time_ms). No measurement behind this value: it only has to be
// larger than those milliseconds and small against that second.
inline constexpr Duration kSettle = std::chrono::milliseconds(100);
// How soon a ready NIC that could not be opened is tried again, and after how long the NICs are
// looked at once more after a change, because the kernel removes some routes without an event. No
// measurement behind this value: it only has to be well within the second in which a link that is
// back must be used.
inline constexpr Duration kRecheck = std::chrono::milliseconds(200);

// The links of a running node.
//
// A link has a socket while its NIC is ready for its peer, and a new one for every incarnation of
// the NIC: a socket stays bound to the card that it was opened on, and what waits in the buffers of
// a card that went is too late anyway. Links that share a NIC share its state, which then is that
// for the first of them that has a peer.
//
// A transport with a program on the NIC (TransportKind::kXdp) is set aside instead of closed as
// long as the NIC is the same and the addresses fit, and serves again when the NIC is ready: some
// NICs are reset when such a program comes or goes, lose their carrier by that, and would be closed
// and opened for ever.
//
// Owns the sockets and the monitor of the NICs. Thread-compatible; driven by the loop of a Node.
// Set-up throws IoError, or std::invalid_argument that names the option. What fails later on
// becomes the link's reason and is tried again every kRecheck; only the set-up waits for the
// kernel.
class LinkSet {
 public:
  struct Link {
    NodeLink options;
    // Made by a NodeNicRule, so that it goes with its NIC; the others stay.
    bool by_rule = false;
    NicState state = NicState::kAbsent;
    // Why the NIC is in this state, or why a ready NIC is not used.
    std::string reason;
    // The errno of the last attempt to open it; 0: it did not fail, or not by a system call.
    int error = 0;
    LinkInfo info;
    // Empty while the NIC cannot be used.
    std::unique_ptr<Transport> transport;
    // Those of the shards, as long as there is `transport`.
    std::vector<std::unique_ptr<Transport>> siblings;
    // Set aside while the NIC cannot be used; the link is closed for all others.
    std::unique_ptr<Transport> aside;
    // When the NIC's carrier came back; the socket is opened kSettle later.
    TimePoint carrier_since = TimePoint::min();
    // The port that the link had when it was first opened; it is bound again each time, so that
    // peers find us. 0 before.
    std::uint16_t port = 0;
  };

  // Whom the set tells of what happens to its links.
  class User {
   public:
    virtual ~User() = default;
    virtual void link_opened(Link& link) = 0;
    // The link's transport still exists during this call.
    virtual void link_closing(Link& link) = 0;
    virtual void nic_changed(const NicChanged& change) = 0;
  };

  // Opens the links whose NICs are ready. `user` must outlive the set and is told of what happens
  // from the first update() on; the links that the constructor opened are found in links().
  LinkSet(const NodeOptions& options, User& user);
  // One without links, for good.
  explicit LinkSet(User& user) : user_(user) {}

  // Readable when update() should be called; -1: never (io::NicMonitor).
  int native_handle() const { return monitor_ ? monitor_->native_handle() : -1; }
  // Takes in what the kernel says of the NICs, opens links whose NICs have become ready and tries
  // those again that failed. Returns when there is reason to call it again although the kernel says
  // nothing.
  std::optional<TimePoint> update(TimePoint now);
  // A send failed with this errno because the NIC is gone; the kernel's event follows later.
  void lost(LinkId link, int error);

  const NodeOptions& options() const { return options_; }
  const std::vector<std::unique_ptr<Link>>& links() const { return links_; }
  Link* find(LinkId link) const;
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  void add_named(const NodeLink& link);
  Link* add_by_rule(const io::Nic& nic);
  Link& add(const NodeLink& link, bool by_rule);
  std::optional<LinkId> free_id() const;
  bool has_link_on(std::string_view nic) const;
  void refuse_nothing_open() const;
  // Opens the link's socket, or takes the one that was set aside. Throws IoError.
  void open(Link& link);
  void open_anew(Link& link, std::vector<std::string>& warnings);
  // As open(), but a failure becomes the link's reason, and the result is false.
  bool try_open(Link& link);
  // Closes the link for the user, and returns the transport that it had.
  std::unique_ptr<Transport> withdraw(Link& link);
  void close(Link& link);
  // The link's NIC cannot be used for now.
  void suspend(Link& link);
  std::optional<TimePoint> open_ready(TimePoint now);
  void apply(TimePoint now, const io::NicEvent& event);
  void rename(const io::NicEvent& event);
  void apply(TimePoint now, const io::NicEvent& event, Link& link);

  NodeOptions options_;
  User& user_;
  std::unique_ptr<io::NicMonitor> monitor_;
  // Pointers, so that a Link stays where it is when others come and go.
  std::vector<std::unique_ptr<Link>> links_;
  std::vector<std::string> warnings_;
  // Whether the user is told of changes: not during the set-up.
  bool telling_ = false;
};

}  // namespace interneuron
