#include "node/loop/whole.h"

#include <algorithm>
#include <utility>

#include "node/io/steady_clock.h"

namespace interneuron {
namespace {

// Whoever adds a counter adds it below, too.
constexpr std::size_t kCounter = sizeof(std::uint64_t);
static_assert(sizeof(LinkCounters) == 14 * kCounter);
static_assert(sizeof(EndpointCounters) == 9 * kCounter);
static_assert(sizeof(TransportCounters) == 11 * kCounter);

void add(LinkCounters& to, const LinkCounters& c) {
  to.sent_packets += c.sent_packets;
  to.sent_bytes += c.sent_bytes;
  to.received_packets += c.received_packets;
  to.received_bytes += c.received_bytes;
  to.duplicate_packets += c.duplicate_packets;
  to.malformed_packets += c.malformed_packets;
  to.other_version_packets += c.other_version_packets;
  to.other_packets += c.other_packets;
  to.refused_packets += c.refused_packets;
  to.unauthentic_packets += c.unauthentic_packets;
  to.handshake_packets += c.handshake_packets;
  to.fragments_resent += c.fragments_resent;
  to.symbols_sent += c.symbols_sent;
  to.fragments_lost += c.fragments_lost;
}

void add(EndpointCounters& to, const EndpointCounters& c) {
  to.messages_completed += c.messages_completed;
  to.messages_expired += c.messages_expired;
  to.messages_superseded += c.messages_superseded;
  to.messages_late += c.messages_late;
  to.fragments_cancelled += c.fragments_cancelled;
  to.bad_messages += c.bad_messages;
  to.foreign_rounds += c.foreign_rounds;
  to.reassembly_refused += c.reassembly_refused;
  to.bad_fragments += c.bad_fragments;
}

void add(TransportCounters& to, const TransportCounters& c) {
  to.sent_datagrams += c.sent_datagrams;
  to.send_calls += c.send_calls;
  to.send_errors += c.send_errors;
  if (c.last_send_error != 0) to.last_send_error = c.last_send_error;
  to.send_refusals += c.send_refusals;
  to.offload_refused += c.offload_refused;
  to.received_datagrams += c.received_datagrams;
  to.receive_calls += c.receive_calls;
  to.receive_errors += c.receive_errors;
  to.receive_queue_drops += c.receive_queue_drops;
  to.error_reports += c.error_reports;
}

// For Shards::sum().
constexpr auto kAdd = [](auto& to, const auto& value) { add(to, value); };

}  // namespace

SendResult Node::Impl::Whole::send(PeerId peer, Variants variants, const SendOptions& options) {
  SendResult result = ask(peer, [&](Endpoint& endpoint) {
    return endpoint.send(io::now(), peer, std::move(variants), options);
  });
  if (shards_ != nullptr)
    result.id = shards_->known_as(shard_of(peer, shards_->count()), result.id);
  return result;
}

std::vector<SendResult> Node::Impl::Whole::send(PeerId peer, std::span<Bytes> messages,
                                                const SendOptions& options) {
  auto results = ask(
      peer, [&](Endpoint& endpoint) { return endpoint.send(io::now(), peer, messages, options); });
  if (shards_ == nullptr) return results;
  for (SendResult& result : results) {
    result.id = shards_->known_as(shard_of(peer, shards_->count()), result.id);
  }
  return results;
}

bool Node::Impl::Whole::cancel(SendId message) {
  if (shards_ == nullptr) return front_.endpoint_.cancel(io::now(), message);
  const auto known = shards_->known_by(message);
  return shards_->ask(known.first,
                      [&](Endpoint& endpoint) { return endpoint.cancel(io::now(), known.second); });
}

std::vector<PeerId> Node::Impl::Whole::peers() {
  if (shards_ == nullptr) return front_.endpoint_.peers();
  auto all = shards_->sum<std::vector<PeerId>>(
      [](const Impl& impl, std::uint8_t) { return impl.endpoint_.peers(); },
      [](auto& to, const auto& more) { to.insert(to.end(), more.begin(), more.end()); });
  std::ranges::sort(all);
  return all;
}

EndpointCounters Node::Impl::Whole::counters() {
  if (shards_ == nullptr) return front_.endpoint_.counters();
  return shards_->sum<EndpointCounters>(
      [](const Impl& impl, std::uint8_t) { return impl.endpoint_.counters(); }, kAdd);
}

LinkCounters Node::Impl::Whole::link_counters(LinkId link) {
  if (shards_ == nullptr) return front_.endpoint_.link_counters(link);
  return shards_->sum<LinkCounters>(
      [link](const Impl& impl, std::uint8_t) { return impl.endpoint_.link_counters(link); }, kAdd);
}

TransportCounters Node::Impl::Whole::transport_counters(LinkId id) {
  const LinkSet::Link* link = front_.links_.find(id);
  if (link == nullptr || !link->transport) return {};
  if (shards_ == nullptr) return link->transport->counters();
  return shards_->sum<TransportCounters>(
      [&](const Impl&, std::uint8_t shard) {
        const auto& transport = shard == 0 ? link->transport : link->siblings[shard - 1U];
        TransportCounters counters = transport->counters();
        counters.receive_queue_drops += shards_->dropped(shard, id);
        return counters;
      },
      kAdd);
}

std::uint64_t Node::Impl::Whole::stalled(LinkId link) {
  if (shards_ == nullptr) return front_.outbox_.stalled(link);
  return shards_->sum<std::uint64_t>(
      [link](const Impl& impl, std::uint8_t) { return impl.outbox_.stalled(link); },
      [](std::uint64_t& to, std::uint64_t more) { to += more; });
}

std::int64_t Node::Impl::Whole::unix_time_ns() {
  const TimePoint now = io::now();
  if (shards_ == nullptr) return front_.endpoint_.unix_time_ns(now);
  return shards_->sum<std::int64_t>(
      [now](const Impl& impl, std::uint8_t) { return impl.endpoint_.unix_time_ns(now); },
      [](std::int64_t& to, std::int64_t more) { to = std::max(to, more); });
}

Statistics Node::Impl::Whole::statistics() {
  Statistics out;
  out.at = io::now();
  for (const auto& link : front_.links_.links()) {
    const LinkId id = link->options.id;
    out.links.push_back({id, link->options.nic, link->state, link->reason, link_counters(id),
                         transport_counters(id)});
  }
  const auto tell = [&out](const Endpoint& endpoint) {
    for (const PeerId peer : endpoint.peers()) {
      out.peers.push_back({peer, endpoint.links(out.at, peer), endpoint.ledger(peer)});
    }
    return true;
  };
  tell(front_.endpoint_);
  for (std::uint8_t shard = 1; shards_ != nullptr && shard <= shards_->count(); ++shard) {
    shards_->ask(shard, tell);
  }
  std::ranges::sort(out.peers, {}, &Statistics::Peer::id);
  out.counters = counters();
  out.loop_stall = front_.loop_stall_;
  return out;
}

}  // namespace interneuron
