// A Node's loop from its begin to its end, and what happens beside its turns: links come and go
// with their NICs, statistics are told.
#include <algorithm>
#include <stdexcept>
#include <utility>

#include "node/io/steady_clock.h"
#include "node/loop/link_set.h"
#include "node/loop/node_impl.h"

namespace interneuron {

namespace {

// How soon a clock that was set is noticed. No measurement behind this value: credentials are valid
// for hours.
constexpr Duration kBetweenClocks = std::chrono::seconds(10);

}  // namespace

Node::Impl::Impl(const EndpointOptions& endpoint, Crew& crew)
    : session_(endpoint.session),
      endpoint_(endpoint, io::now()),
      links_(*this),
      shard_(endpoint.shard.index),
      crew_(&crew),
      computation_(0),
      backup_(0) {}

Node::Impl::~Impl() { shut_down(); }

// Ends all threads; may be called more than once. Afterwards only the caller's uses this object.
void Node::Impl::shut_down() {
  if (shards_) shards_->stop();
  computation_.stop();
  backup_.stop();
  signals_.reset();
}

void Node::Impl::run() {
  if (std::exchange(ran_, true)) throw std::logic_error("Node::run: a node runs once");
  const io::PreciseTimers precise;
  const auto enter = [this] {
    return crew_ != nullptr ? crew_->enter(shard_) : std::unique_lock<std::mutex>();
  };
  try {
    if (shards_) shards_->start();
    {
      const auto shift = enter();
      repeat_statistics(saturating_add(io::now(), handlers.statistics_interval));
      repeat_clock();
      poller_.prepare(io::Poller::For::kAnything);
    }
    while (!stopped_) {
      const Ready ready = poller_.wait(wakes_at_);
      const auto shift = enter();
      wake_up(ready);
    }
    // What can leave at once still does.
    const auto shift = enter();
    outbox_.pump(io::now(), *this);
  } catch (...) {
    stopped_ = true;
    shut_down();
    throw;
  }
  shut_down();
}

// The clock of a host may be set long after its programs have begun, and it judges credentials.
void Node::Impl::repeat_clock() {
  endpoint_.raise_unix_time_ns(io::now(), io::unix_time_ns());
  at(io::now() + kBetweenClocks, [this] { repeat_clock(); });
}

void Node::Impl::stop_on_signals() {
  signals_ = std::make_unique<SignalThread>([this](int signal) {
    signal_ = signal;
    stop();
  });
}

// Begins to talk to the peer over the links that are open.
void Node::Impl::connect() {
  std::vector<std::pair<LinkId, Address>> addresses;
  for (const auto& link : links_.links()) {
    if (!link->transport) continue;
    open_port(link->options.id, *link->transport, link->info);
    if (shards_) shards_->open(*link);
    if (const auto peer = parse_address(link->options.peer)) {
      addresses.emplace_back(link->options.id, *peer);
    }
  }
  if (!addresses.empty()) peer_ = connect(addresses, links_.options().peer_key);
}

PeerId Node::Impl::connect(std::span<const std::pair<LinkId, Address>> addresses,
                           const std::optional<PublicKey>& key) {
  for (const auto& [link, address] : addresses) check_peer_address(links_.options(), address);
  if (shards_) throw std::invalid_argument("connect: a node of several shards connects to nobody");
  return endpoint_.connect(io::now(), addresses, key);
}

void Node::Impl::open_port(LinkId id, Transport& transport, const LinkInfo& info) {
  poller_.add(transport.native_handle(), id.value);
  ports_.push_back({id, &transport});
  outbox_.add(id, transport);
  endpoint_.add_link(io::now(), id, info);
}

void Node::Impl::link_opened(LinkSet::Link& link) {
  open_port(link.options.id, *link.transport, link.info);
  if (shards_) shards_->open(link);
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
  if (shards_) shards_->close(link.options.id);
  close_port(link.options.id);
}

void Node::Impl::close_port(LinkId id) {
  const auto port = std::ranges::find(ports_, id, &Port::link);
  if (port == ports_.end()) return;
  poller_.remove(port->transport->native_handle());
  ports_.erase(port);
  outbox_.remove(id);
  endpoint_.remove_link(io::now(), id);
}

void Node::Impl::nic_changed(const NicChanged& change) {
  if (handlers.nic_changed) run_work([&] { handlers.nic_changed(change); });
}

void Node::Impl::repeat_statistics(TimePoint due) {
  if (!handlers.statistics) return;
  at(due, [this, due] {
    handlers.statistics();
    // The interval is kept on average, but a long handler is not followed by two calls at once.
    repeat_statistics(std::max(saturating_add(due, handlers.statistics_interval), io::now()));
  });
}

}  // namespace interneuron
