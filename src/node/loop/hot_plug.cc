// The part of a Node's loop that follows its NICs: links come and go while it runs.
#include <algorithm>
#include <stdexcept>
#include <utility>

#include "node/io/steady_clock.h"
#include "node/loop/node_impl.h"
#include "node/loop/setup.h"

namespace interneuron {

using boost::asio::posix::stream_descriptor;
using boost::system::error_code;

// Begins to talk to the peer over the links that are open.
void Node::Impl::connect() {
  std::vector<std::pair<LinkId, Address>> addresses;
  for (const auto& link : links_.links()) {
    if (!link->transport) continue;
    open_port(*link);
    if (const auto peer = parse_address(link->options.peer)) {
      addresses.emplace_back(link->options.id, *peer);
    }
  }
  if (!addresses.empty()) peer_ = connect(addresses, links_.options().peer_key);
}

PeerId Node::Impl::connect(std::span<const std::pair<LinkId, Address>> addresses,
                           const std::optional<PublicKey>& key) {
  for (const auto& [link, address] : addresses) check_peer_address(links_.options(), address);
  return endpoint_.connect(io::now(), addresses, key);
}

void Node::Impl::open_port(const LinkSet::Link& link) {
  const LinkId id = link.options.id;
  ports_.push_back(std::make_shared<Port>(Port{
      id, link.transport.get(), stream_descriptor(context_, link.transport->native_handle())}));
  outbox_.add(id, *link.transport);
  endpoint_.add_link(io::now(), id, link.info);
}

void Node::Impl::link_opened(LinkSet::Link& link) {
  open_port(link);
  wait_readable(ports_.back());
  const auto address = parse_address(link.options.peer);
  if (!address) return;
  const std::pair path{link.options.id, *address};
  if (peer_) {
    endpoint_.add_path(io::now(), *peer_, path.first, path.second);
  } else {
    peer_ = connect({&path, 1}, links_.options().peer_key);
  }
}

void Node::Impl::link_closing(LinkSet::Link& link) {
  const LinkId id = link.options.id;
  const auto port = std::ranges::find_if(ports_, [id](const auto& p) { return p->link == id; });
  if (port == ports_.end()) return;
  // The descriptor belongs to the transport, which closes it.
  (*port)->watcher.release();
  (*port)->transport = nullptr;
  ports_.erase(port);
  outbox_.remove(id);
  endpoint_.remove_link(io::now(), id);
}

void Node::Impl::nic_changed(const NicChanged& change) {
  if (handlers.nic_changed) run_work([&] { handlers.nic_changed(change); });
}

void Node::Impl::wait_for_nics() {
  nic_watcher_.async_wait(stream_descriptor::wait_read, [this](const error_code& error) {
    if (error) return;
    check_nics();
    turn();
    if (nic_watcher_.is_open()) wait_for_nics();
  });
}

void Node::Impl::check_nics() {
  const auto next = links_.update(io::now());
  if (!next || (recheck_at_ && *recheck_at_ <= *next)) return;
  recheck_at_ = next;
  at(*next, [this, due = *next] {
    // A check for an earlier time was asked for meanwhile and has replaced this one.
    if (recheck_at_ != due) return;
    recheck_at_.reset();
    check_nics();
  });
}

// Closes the links whose NIC a send has found gone, which may be before the kernel's event arrives.
// True when there were any.
bool Node::Impl::lose_gone_links() {
  const auto gone = outbox_.take_gone();
  for (const auto& [id, error] : gone) links_.lost(id, error);
  if (!gone.empty()) check_nics();
  return !gone.empty();
}

void Node::Impl::set_statistics(Duration interval, std::function<void(const Statistics&)> handler) {
  if (interval <= Duration::zero()) {
    throw std::invalid_argument("on_statistics: the interval must be positive");
  }
  statistics_interval_ = interval;
  handlers.statistics = std::move(handler);
}

void Node::Impl::repeat_statistics(TimePoint due) {
  if (!handlers.statistics) return;
  at(due, [this, due] {
    handlers.statistics(statistics());
    // The interval is kept on average, but a long handler is not followed by two calls at once.
    repeat_statistics(std::max(saturating_add(due, statistics_interval_), io::now()));
  });
}

Statistics Node::Impl::statistics() const {
  Statistics out;
  out.at = io::now();
  for (const auto& link : links_.links()) {
    const LinkId id = link->options.id;
    out.links.push_back({id, link->options.nic, link->state, link->reason,
                         endpoint_.link_counters(id),
                         link->transport ? link->transport->counters() : TransportCounters{}});
  }
  for (const PeerId peer : endpoint_.peers()) {
    out.peers.push_back({peer, endpoint_.links(out.at, peer), endpoint_.ledger(peer)});
  }
  out.counters = endpoint_.counters();
  out.loop_stall = loop_stall_;
  return out;
}

}  // namespace interneuron
