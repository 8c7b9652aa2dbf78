#include "interneuron/node.h"

#include <stdexcept>

#include "node/io/steady_clock.h"
#include "node/loop/whole.h"

namespace interneuron {

// The front makes its shards, which make loops of their own.
Node::Impl::Impl(NodeOptions options)
    : Impl(std::move(options), (check_options(options), endpoint_options(options))) {}

Node::Impl::Impl(NodeOptions&& options, const EndpointOptions& endpoint)
    : session_(endpoint.session),
      endpoint_(endpoint, io::now()),
      links_(options, *this),
      computation_(options.computation_workers),
      backup_(options.backup_workers) {
  try {
    if (links_.native_handle() >= 0) poller_.add(links_.native_handle(), kNics);
    if (endpoint.shard.count > 0) {
      shards_ = std::make_unique<Shards>(*this, options, endpoint);
      crew_ = shards_.get();
    }
    connect();
  } catch (...) {
    shut_down();
    throw;
  }
}

Node::Node(NodeOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Node::~Node() = default;

void Node::on_delivered(std::function<void(Delivered)> handler) {
  impl_->handlers.delivered = std::move(handler);
}
void Node::on_round_done(std::function<void(RoundDone)> handler) {
  impl_->handlers.round_done = std::move(handler);
}
void Node::on_peer_ready(std::function<void(PeerReady)> handler) {
  impl_->handlers.peer_ready = std::move(handler);
}
void Node::on_peer_restarted(std::function<void(PeerRestarted)> handler) {
  impl_->handlers.peer_restarted = std::move(handler);
}
void Node::on_peer_lost(std::function<void(PeerLost)> handler) {
  impl_->handlers.peer_lost = std::move(handler);
}
void Node::on_planned(std::function<void(Planned)> handler) {
  impl_->handlers.planned = std::move(handler);
}
void Node::on_nic_changed(std::function<void(NicChanged)> handler) {
  impl_->handlers.nic_changed = std::move(handler);
}
void Node::on_path_changed(std::function<void(PathChanged)> handler) {
  impl_->handlers.path_changed = std::move(handler);
}
void Node::on_other_version(std::function<void(OtherVersion)> handler) {
  impl_->handlers.other_version = std::move(handler);
}
void Node::on_peer_limited(std::function<void(PeerLimited)> handler) {
  impl_->handlers.peer_limited = std::move(handler);
}
void Node::on_revocations_changed(std::function<void(RevocationsChanged)> handler) {
  impl_->handlers.revocations_changed = std::move(handler);
}
void Node::on_key_shared(std::function<void(KeyShared)> handler) {
  impl_->handlers.key_shared = std::move(handler);
}
void Node::on_message(std::function<void(Message)> handler) {
  impl_->handlers.message = std::move(handler);
}
void Node::on_fate(std::function<void(MessageFate)> handler) {
  impl_->handlers.fate = std::move(handler);
}
void Node::on_can_send(std::function<void(CanSend)> handler) {
  impl_->handlers.can_send = std::move(handler);
}
void Node::on_statistics(Duration interval, std::function<void(const Statistics&)> handler) {
  if (interval <= Duration::zero()) {
    throw std::invalid_argument("on_statistics: the interval must be positive");
  }
  impl_->handlers.statistics_interval = interval;
  impl_->handlers.statistics = nullptr;
  if (!handler) return;
  impl_->handlers.statistics = [impl = impl_.get(), handler = std::move(handler)] {
    handler(Impl::Whole(*impl).statistics());
  };
}

PeerId Node::connect(std::span<const std::pair<LinkId, Address>> addresses,
                     const std::optional<PublicKey>& key) {
  return impl_->connect(addresses, key);
}
bool Node::request_train(PeerId peer, LinkId link) {
  return Impl::Whole(*impl_).ask(
      peer, [&](Endpoint& e) { return e.request_train(io::now(), peer, link); });
}
SendResult Node::send(PeerId peer, Bytes message, const SendOptions& options) {
  Variants variants;
  variants.push_back(std::move(message));
  return send(peer, std::move(variants), options);
}
SendResult Node::send(PeerId peer, Variants variants, const SendOptions& options) {
  return Impl::Whole(*impl_).send(peer, std::move(variants), options);
}
std::vector<SendResult> Node::send(PeerId peer, std::span<Bytes> messages,
                                   const SendOptions& options) {
  return Impl::Whole(*impl_).send(peer, messages, options);
}
bool Node::cancel(SendId message) { return Impl::Whole(*impl_).cancel(message); }
RoundRef Node::begin_round(PipelineId pipeline) {
  return impl_->endpoint().begin_round(io::now(), pipeline);
}
Plan Node::preview(RoundRef round, std::span<const std::size_t> variant_bytes,
                   MessageClass message_class, std::span<const VariantCost> costs,
                   std::optional<PeerId> to) {
  return Impl::Whole(*impl_).ask(round, [&](Endpoint& e) {
    return e.preview(io::now(), round, variant_bytes, message_class, costs, to);
  });
}
std::size_t Node::begin_computation(RoundRef round, std::span<const LevelProfile> levels,
                                    std::size_t top) {
  return Impl::Whole(*impl_).ask(
      round, [&](Endpoint& e) { return e.begin_computation(io::now(), round, levels, top); });
}
SubmitStatus Node::submit(RoundRef round, Variants variants, MessageClass message_class,
                          std::optional<PeerId> to) {
  return Impl::Whole(*impl_).ask(round, [&](Endpoint& e) {
    return e.submit(io::now(), round, std::move(variants), message_class, to);
  });
}
void Node::local_result(RoundRef round, Bytes result) {
  impl_->endpoint().local_result(io::now(), round, std::move(result));
}

void Node::give_up(RoundRef round) { impl_->endpoint().give_up(io::now(), round); }

TimePoint Node::now() const { return io::now(); }
void Node::after(Duration delay, Task task) {
  impl_->at(saturating_add(io::now(), delay), std::move(task));
}
void Node::at(TimePoint time, Task task) { impl_->at(time, std::move(task)); }
void Node::compute(Queue queue, Job job) { impl_->compute(queue, std::move(job)); }
void Node::post(Task task) { impl_->post(std::move(task)); }

void Node::run() { impl_->run(); }
void Node::stop() { impl_->stop(); }
void Node::stop_on_signals() { impl_->stop_on_signals(); }
int Node::stopped_by_signal() const { return impl_->signal(); }

SessionId Node::session() const { return impl_->session(); }
std::optional<PeerId> Node::peer() const { return impl_->peer(); }
std::vector<PeerId> Node::peers() const { return Impl::Whole(*impl_).peers(); }
std::vector<LinkState> Node::links(PeerId peer) const {
  return Impl::Whole(*impl_).ask(peer, [&](Endpoint& e) { return e.links(io::now(), peer); });
}
Statistics Node::statistics() const { return Impl::Whole(*impl_).statistics(); }
EndpointCounters Node::counters() const { return Impl::Whole(*impl_).counters(); }
LinkCounters Node::link_counters(LinkId link) const {
  return Impl::Whole(*impl_).link_counters(link);
}
std::size_t Node::reassembly_bytes() const { return impl_->endpoint().reassembly_bytes(); }

TransportCounters Node::transport_counters(LinkId id) const {
  return Impl::Whole(*impl_).transport_counters(id);
}
TransportCaps Node::transport_capabilities(LinkId id) const {
  const LinkSet::Link* link = impl_->links().find(id);
  return link != nullptr && link->transport ? link->transport->capabilities() : TransportCaps{};
}
std::optional<Address> Node::local_address(LinkId id) const {
  const LinkSet::Link* link = impl_->links().find(id);
  if (link == nullptr || !link->transport) return std::nullopt;
  return link->transport->local_address();
}
std::int64_t Node::unix_time_ns() const { return Impl::Whole(*impl_).unix_time_ns(); }
std::uint64_t Node::stalled_datagrams(LinkId link) const {
  return Impl::Whole(*impl_).stalled(link);
}
const std::vector<std::string>& Node::warnings() const { return impl_->links().warnings(); }

}  // namespace interneuron
