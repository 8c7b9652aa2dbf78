#include "node/monitor/link_monitor.h"

#include <linux/rtnetlink.h>

#include <algorithm>
#include <map>
#include <utility>

#include "node/io/address.h"
#include "node/io/parts.h"
#include "node/monitor/netlink.h"
#include "node/monitor/netlink_message.h"
#include "node/monitor/nic_table.h"
#include "node/monitor/route_query.h"

namespace interneuron::io {

namespace {

// What became of a NIC's addresses, in words; empty when only their order is another.
std::string address_change(const std::vector<Address>& before, const std::vector<Address>& now) {
  const auto missing_in = [](const std::vector<Address>& where) {
    return [&where](const Address& address) {
      return std::ranges::find(where, address) == where.end();
    };
  };
  if (const auto it = std::ranges::find_if(now, missing_in(before)); it != now.end()) {
    return "address " + host_text(*it) + " was added";
  }
  const auto it = std::ranges::find_if(before, missing_in(now));
  return it == before.end() ? "" : "address " + host_text(*it) + " is gone";
}

}  // namespace

class LinkMonitor::Impl {
 public:
  explicit Impl(const Options& options);

  int native_handle() const { return nl_socket_get_fd(events_.get()); }
  std::vector<NicEvent> update();
  void require(std::string_view name, std::optional<Address> peer);

  const NicTable& table() const { return table_; }
  nl_sock* requests() const { return requests_.get(); }
  std::uint64_t resyncs() const { return resyncs_; }

  // What is known of a name. Names without a NIC are kept only if something is required of them.
  struct Record {
    // The peer that must be routed. An empty Address: it is enough that the NIC has an address.
    std::optional<Address> peer;
    NicState state = NicState::kAbsent;
    std::string reason;
    // The index of the newest NIC of this name.
    int index = 0;
    std::size_t mtu = 0;
    // Those that a socket may be bound to.
    std::vector<Address> addresses;
    // The address that counts for incarnations; kept when it is removed.
    Address first{};
    std::optional<Address> source;
  };
  const Record* record(std::string_view name) const {
    const auto it = records_.find(name);
    return it == records_.end() ? nullptr : &it->second;
  }

 private:
  // Takes in one event of the kernel.
  void take(const nlmsghdr& message);
  // Reads everything anew, after events were lost.
  void resync();
  // Brings all records up to date with the table and returns what has changed. `former_names` are
  // the names that NICs had before, by index.
  std::vector<NicEvent> evaluate();
  // A NIC that is required and has another name now is required by that. Returns its former name;
  // empty where that does not hold.
  std::string follow(const Nic& nic, const std::map<int, std::string>& former_names);
  std::optional<NicEvent> evaluate(const std::string& name, Record& record,
                                   const std::map<int, std::string>& former_names);
  std::optional<NicEvent> evaluate_present(const Nic& nic, Record& record,
                                           const std::string& former_name);
  // The state of a NIC that is there: from its flags and addresses, then from its routes.
  NicVerdict judge(const Record& record, const Nic& nic);
  NicVerdict judge_route(const Record& record, const Nic& nic, const NicVerdict& ready);
  // Why a NIC is not there any more.
  std::string absence(const Record& record) const;
  // The one place where a state changes.
  NicEvent set_state(const std::string& name, Record& record, NicState state, std::string reason);

  bool default_routes_;
  // What must be read anew: the default routes, or the whole table after a reading that failed.
  bool routes_stale_ = false;
  bool table_stale_ = false;
  std::uint64_t resyncs_ = 0;
  netlink::Socket events_;
  netlink::Socket requests_;
  NicTable table_;
  std::map<std::string, Record, std::less<>> records_;
};

LinkMonitor::Impl::Impl(const Options& options)
    : default_routes_(options.default_routes),
      // Opened before the table is read, so that changes during the reading arrive as events.
      events_(netlink::open_event_socket(
          {RTNLGRP_LINK, RTNLGRP_IPV4_IFADDR, RTNLGRP_IPV6_IFADDR, RTNLGRP_IPV4_ROUTE,
           RTNLGRP_IPV6_ROUTE, RTNLGRP_IPV4_RULE, RTNLGRP_IPV6_RULE},
          options.receive_buffer_bytes)),
      requests_(netlink::open_socket()) {
  table_.read(requests_.get(), default_routes_);
  table_.refresh_lagging(requests_.get());
  evaluate();
}

std::vector<NicEvent> LinkMonitor::Impl::update() {
  const bool complete =
      netlink::drain(events_.get(), [this](const nlmsghdr& message) { take(message); });
  if (!complete || table_stale_) resync();
  table_.refresh_lagging(requests_.get());
  if (std::exchange(routes_stale_, false) && default_routes_) {
    // The kernel refused (out of memory); the next call tries again.
    routes_stale_ = !table_.read_default_routes(requests_.get());
  }
  return evaluate();
}

void LinkMonitor::Impl::take(const nlmsghdr& message) {
  switch (message.nlmsg_type) {
    case RTM_NEWROUTE:
    case RTM_DELROUTE:
      if (netlink::is_default_route(message)) routes_stale_ = true;
      return;
    case RTM_NEWRULE:
    case RTM_DELRULE:
      return;
    default:
      // When a NIC or an address goes, the kernel removes its IPv4 routes without an event.
      routes_stale_ = true;
      table_.apply(message);
  }
}

void LinkMonitor::Impl::resync() {
  if (!std::exchange(table_stale_, true)) ++resyncs_;
  // Events that are queued are older than what is read now and are dropped first; events that come
  // meanwhile stay queued and are applied afterwards.
  netlink::drain(events_.get(), [](const nlmsghdr&) {});
  NicTable fresh;
  try {
    fresh.read(requests_.get(), default_routes_);
  } catch (const IoError&) {
    // Out of memory, or the table changed during every attempt; the next call tries again.
    return;
  }
  table_ = std::move(fresh);
  table_stale_ = false;
}

void LinkMonitor::Impl::require(std::string_view name, std::optional<Address> peer) {
  auto it = records_.find(name);
  if (it == records_.end()) it = records_.try_emplace(std::string(name)).first;
  Record& record = it->second;
  record.peer = peer;
  record.source.reset();
  // It is judged anew, as if it had come just now.
  record.state = NicState::kAbsent;
  record.reason = "there is no network card of this name";
  evaluate(it->first, record, {});
}

std::vector<NicEvent> LinkMonitor::Impl::evaluate() {
  std::map<int, std::string> former_names;
  for (const auto& [name, record] : records_) {
    if (record.state != NicState::kAbsent) former_names[record.index] = name;
  }
  std::map<std::string, std::string, std::less<>> followed;
  for (const Nic& nic : table_.nics()) {
    if (std::string former = follow(nic, former_names); !former.empty()) {
      followed[nic.name] = std::move(former);
    }
    records_.try_emplace(nic.name);
  }
  std::vector<NicEvent> out;
  for (auto& [name, record] : records_) {
    auto event = evaluate(name, record, former_names);
    if (!event) continue;
    if (const auto it = followed.find(name); it != followed.end()) event->former_name = it->second;
    out.push_back(std::move(*event));
  }
  std::erase_if(records_, [](const auto& item) {
    return item.second.state == NicState::kAbsent && !item.second.peer;
  });
  table_.forget_departures();
  return out;
}

std::string LinkMonitor::Impl::follow(const Nic& nic,
                                      const std::map<int, std::string>& former_names) {
  const auto former = former_names.find(nic.index);
  if (former == former_names.end() || former->second == nic.name) return {};
  const auto old = records_.find(former->second);
  const auto present = records_.find(nic.name);
  const bool is_taken = present != records_.end() && present->second.peer;
  // Names that two NICs have exchanged are two other cards.
  if (!old->second.peer || is_taken || table_.find(former->second) != nullptr) return {};
  auto moved = records_.extract(old);
  if (present != records_.end()) records_.erase(present);
  moved.key() = nic.name;
  records_.insert(std::move(moved));
  return former->second;
}

std::optional<NicEvent> LinkMonitor::Impl::evaluate(
    const std::string& name, Record& record, const std::map<int, std::string>& former_names) {
  if (const Nic* nic = table_.find(name)) {
    const auto former = former_names.find(nic->index);
    const bool renamed = former != former_names.end() && former->second != name;
    return evaluate_present(*nic, record, renamed ? former->second : "");
  }
  if (record.state == NicState::kAbsent) return std::nullopt;
  record.addresses.clear();
  record.source.reset();
  NicEvent event = set_state(name, record, NicState::kAbsent, absence(record));
  event.index = 0;
  return event;
}

std::optional<NicEvent> LinkMonitor::Impl::evaluate_present(const Nic& nic, Record& record,
                                                            const std::string& former_name) {
  const bool plugged = record.state == NicState::kAbsent;
  const bool replaced = !plugged && record.index != nic.index;
  if (plugged || replaced) record.first = {};
  record.index = nic.index;
  const std::size_t old_mtu = std::exchange(record.mtu, nic.mtu);
  const auto old_addresses = std::exchange(record.addresses, {});
  std::ranges::copy_if(nic.addresses, std::back_inserter(record.addresses),
                       [&](const Address& address) { return is_usable(address, record.peer); });
  NicVerdict verdict = judge(record, nic);

  // The first address stays the first while it is there, even if the kernel lists another before
  // it.
  const Address old_first = record.first;
  if (!record.addresses.empty() &&
      std::ranges::find(record.addresses, old_first) == record.addresses.end()) {
    record.first = record.addresses.front();
  }
  const bool resized = !plugged && old_mtu != nic.mtu;
  const bool readdressed = old_first.size != 0 && record.first != old_first;
  bool rerouted = false;
  if (verdict.state == NicState::kReady) {
    rerouted = record.source != verdict.source;
    record.source = verdict.source;
  }

  std::string change;
  if (!former_name.empty()) {
    change = "renamed from " + former_name;
  } else if (replaced) {
    change = "another network card of the same name";
  } else if (resized) {
    change = "MTU " + std::to_string(old_mtu) + " became " + std::to_string(nic.mtu);
  } else if (readdressed) {
    change = "address " + host_text(old_first) + " became " + host_text(record.first);
  } else if (record.addresses != old_addresses) {
    change = address_change(old_addresses, record.addresses);
  } else if (rerouted) {
    change = "it is routed by another source address";
  }
  if (verdict.state == record.state) {
    if (change.empty()) return std::nullopt;
    verdict.reason = std::move(change);
  } else if (!former_name.empty() || replaced) {
    verdict.reason = change + "; " + verdict.reason;
  }
  NicEvent event = set_state(nic.name, record, verdict.state, std::move(verdict.reason));
  event.new_incarnation = plugged || replaced || resized || readdressed || rerouted;
  return event;
}

NicVerdict LinkMonitor::Impl::judge(const Record& record, const Nic& nic) {
  NicVerdict card = judge_card(nic, record.addresses, record.peer);
  if (card.state == NicState::kNoAddress && record.first.size != 0) {
    card.reason = "address " + host_text(record.first) + " is gone";
  }
  return card.state == NicState::kReady ? judge_route(record, nic, card) : card;
}

NicVerdict LinkMonitor::Impl::judge_route(const Record& record, const Nic& nic,
                                          const NicVerdict& ready) {
  if (!record.peer) {
    const bool routed =
        !default_routes_ || std::ranges::any_of(record.addresses, [&](const Address& address) {
          return table_.has_default_route(nic.index, is_ipv6(address));
        });
    if (routed) return ready;
    return {NicState::kNoRoute, "no default route leads through it"};
  }
  if (record.peer->size == 0 || is_routed(requests_.get(), nic.index, *record.peer, std::nullopt)) {
    return ready;
  }
  for (const Address& address : record.addresses) {
    if (!is_routed(requests_.get(), nic.index, *record.peer, address)) continue;
    return {NicState::kReady, "ready with address " + host_text(address) + " as source", address};
  }
  return {NicState::kNoRoute, "nothing routes to " + host_text(*record.peer) + " through it"};
}

std::string LinkMonitor::Impl::absence(const Record& record) const {
  if (const Nic* nic = table_.find(record.index)) return "renamed to " + nic->name;
  return std::string(table_.departure(record.index));
}

NicEvent LinkMonitor::Impl::set_state(const std::string& name, Record& record, NicState state,
                                      std::string reason) {
  NicEvent event{.nic = name,
                 .index = record.index,
                 .from = std::exchange(record.state, state),
                 .to = state,
                 .reason = reason};
  record.reason = std::move(reason);
  return event;
}

LinkMonitor::LinkMonitor(const Options& options) : impl_(std::make_unique<Impl>(options)) {}
LinkMonitor::~LinkMonitor() = default;

int LinkMonitor::native_handle() const { return impl_->native_handle(); }
std::vector<NicEvent> LinkMonitor::update() { return impl_->update(); }
const std::vector<Nic>& LinkMonitor::nics() const { return impl_->table().nics(); }

NicState LinkMonitor::state(std::string_view name) const {
  const auto* record = impl_->record(name);
  return record == nullptr ? NicState::kAbsent : record->state;
}

std::string_view LinkMonitor::reason(std::string_view name) const {
  const auto* record = impl_->record(name);
  return record == nullptr ? "there is no network card of this name"
                           : std::string_view(record->reason);
}

void LinkMonitor::require_route(std::string_view name, const Address& peer) {
  impl_->require(name, peer);
}
void LinkMonitor::require_nothing(std::string_view name) { impl_->require(name, std::nullopt); }

std::optional<Address> LinkMonitor::required_source(std::string_view name) const {
  const auto* record = impl_->record(name);
  return record == nullptr ? std::nullopt : record->source;
}

void LinkMonitor::drop_unanswered_neighbours(std::string_view name) {
  const Nic* nic = find(name);
  if (nic != nullptr) io::drop_unanswered_neighbours(impl_->requests(), nic->index);
}

std::uint64_t LinkMonitor::resyncs() const { return impl_->resyncs(); }

namespace {

std::vector<Nic> list_by_netlink() {
  const netlink::Socket requests = netlink::open_socket();
  NicTable table;
  table.read(requests.get(), true);
  table.refresh_lagging(requests.get());
  return table.nics();
}

std::unique_ptr<NicMonitor> open_link_monitor() {
  return std::make_unique<LinkMonitor>(LinkMonitor::Options{.default_routes = false});
}

}  // namespace

}  // namespace interneuron::io

const interneuron::io::MonitorPart interneuron_monitor_part{interneuron::io::open_link_monitor,
                                                            interneuron::io::list_by_netlink};
