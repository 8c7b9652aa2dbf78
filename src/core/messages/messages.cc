#include "core/messages/messages.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/base/earliest.h"
#include "core/plan/plan_message.h"
#include "core/wire/header.h"
#include "core/wire/plain_header.h"

namespace interneuron::messages {
namespace {

// How long beyond a round trip after the deadline a fate is waited for (send.h). Feedback comes
// 5 ms after a message at the latest (src/core/peers/feedback_due.h), so that several may be lost.
constexpr Duration kGrace = std::chrono::milliseconds(50);
// How often it is checked whether channels that were refused can send again. No measurement behind
// this value: it only has to be short against the deadlines of messages.
constexpr Duration kRecheck = std::chrono::milliseconds(10);
// Longer than this a fate is not waited for beyond the deadline, whatever round-trip time the peer
// makes us measure. No measurement behind it: cellular links with full queues take some hundred
// milliseconds.
constexpr Duration kLongestRoundTrip = std::chrono::seconds(2);
// A channel that could not send again for so long is not told any more. No measurement behind this
// value: an application that still wants to send has asked again long since.
constexpr Duration kLongestWait = std::chrono::seconds(10);

// What is wrong with a message by itself.
std::optional<SendStatus> fault(const Variants& variants, const SendOptions& options) {
  if (options.deadline <= Duration::zero()) return SendStatus::kDeadlinePast;
  if (variants.empty() || std::ranges::any_of(variants, &Bytes::empty)) return SendStatus::kEmpty;
  const auto too_large = [](const Bytes& b) { return b.size() > kMaxMessageBytes; };
  if (variants.size() > kMaxVariants || std::ranges::any_of(variants, too_large)) {
    return SendStatus::kTooLarge;
  }
  return std::nullopt;
}

// A policy over those links alone that are as secure as the message asks.
class Floored final : public Policy {
 public:
  Floored(const Policy& inner, double floor) : inner_(inner), floor_(floor) {}
  std::string_view name() const override { return inner_.name(); }
  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    Links allowed;
    for (const LinkState& link : links) {
      if (allows(link)) allowed.push_back(link);
    }
    if (std::ranges::any_of(allowed, &LinkState::up)) {
      return inner_.plan(offer, allowed, guidance);
    }
    Plan refusal;
    refusal.refused = kInsecure;
    return refusal;
  }
  Merge merge(const Arrival& arrival) const override { return inner_.merge(arrival); }
  bool allows(const LinkState& link) const override {
    return link.nature.security >= floor_ && inner_.allows(link);
  }

 private:
  const Policy& inner_;
  double floor_;
};

QoS qos_of(const SendOptions& options) {
  QoS qos{.deadline = options.deadline};
  qos.needs = options.needs.weights;
  return qos;
}

// What the chances of a message are judged by.
Outlook outlook_of(PeerId to, const SendOptions& options, std::size_t bytes,
                   std::span<const LinkState> links, const dispatch::Routes& routes,
                   bool accepted) {
  Outlook outlook{.peer = to, .deadline = options.deadline, .bytes = bytes, .refused = !accepted};
  if (routes.first) {
    const LinkState& link = *std::ranges::find(links, routes.first->link, &LinkState::id);
    outlook.has_link = true;
    outlook.expected = routes.first->expected;
    outlook.least = routes.first->least;
    outlook.path = link.path;
    outlook.rate = link.rate;
    outlook.share = link.share;
  }
  return outlook;
}

// For how long beyond the deadline the peer's word of a message may take: the longest round trip of
// the links that it sets out over.
Duration round_trip(const dispatch::Itinerary& itinerary, std::span<const LinkState> links) {
  Duration longest{};
  for (const dispatch::Carriers& c : itinerary) {
    for (const LinkId id : c.links) {
      longest = std::max(longest, std::ranges::find(links, id, &LinkState::id)->rtt_p50);
    }
  }
  return std::min(longest, kLongestRoundTrip);
}

}  // namespace

Messages::Messages(const plan::PolicyRegistry& policies, peers::Peers& peers, HeldMemory& held,
                   const PeerLimits& limits, std::deque<Event>& events)
    : policies_(policies), peers_(peers), events_(events), inbox_(peers, events, held, limits) {}

// --- sending

SendResult Messages::send(TimePoint now, PeerId to, Variants variants, const SendOptions& asked) {
  SendOptions options = asked;
  options.deadline = options.bulk ? kLongestDeadline : std::min(options.deadline, kLongestDeadline);
  const Policy* inner = policies_.find(options.policy);
  if (inner == nullptr) {
    throw std::invalid_argument("send: policy '" + options.policy + "' is not registered");
  }
  if (!(options.needs.min_security >= 0 && options.needs.min_security <= 1)) {
    throw std::invalid_argument("send: min_security must be from 0 to 1");
  }
  const Floored policy(*inner, options.needs.min_security);
  if (const auto wrong = fault(variants, options)) return {*wrong};
  peers::Peer* peer = peers_.access(now, to);
  if (peer == nullptr) return {SendStatus::kNoPeer};
  const dispatch::Sizes sizes = dispatch::sizes_of(variants);
  if (!options.bulk) peer->paths().asked(now, sizes, options.deadline);
  const Links links = peer->links(now);
  dispatch::Routes routes;
  SendResult result = plan(now, *peer, policy, links, sizes, options, routes);
  const auto may_change = {SendStatus::kNoLink, SendStatus::kCannotArrive, SendStatus::kOverBudget};
  if (std::ranges::find(may_change, result.status) != may_change.end()) {
    wait({to, sizes, options, now});
  }
  // Tells what is expected of the message; nothing here is decided by it.
  Outlook outlook;
  double on_time = 0;
  if (result.accepted() || result.status == SendStatus::kCannotArrive) {
    outlook = outlook_of(to, options, sizes.front(), links, routes, result.accepted());
    on_time = forecasts_.predict(outlook);
    result.on_time = on_time;
  }
  if (!result.accepted()) return result;

  if (options.newest_only) supersede(now, to, options.channel);
  routes.itinerary.settle_merge(policy);
  const Duration deadline = options.deadline;
  const wire::PlainHeader header = header_of(now, *peer, options);
  SentMessages::Entry entry{.peer = to,
                            .channel = options.channel,
                            .newest_only = options.newest_only,
                            .in_order = options.in_order_within > Duration::zero(),
                            .t0 = now,
                            .deadline = now + deadline,
                            .ends = now + deadline + kGrace + round_trip(routes.itinerary, links),
                            .wanted = plan::rate_wanted(qos_of(options), sizes.front())};
  const flow::Sender::Times times{.deadline = entry.deadline,
                                  .lifetime = deadline,
                                  .importance = dispatch::importance_of(options)};
  for (const dispatch::Dispatched& d :
       dispatch::dispatch(now, *peer, header, routes.itinerary, times,
                          dispatch::allowed_of(policy, links), variants)) {
    entry.variants.push_back({d.message, d.variant});
  }
  result.id = sent_.add(entry);
  forecasts_.sent(result.id, outlook, on_time);
  return result;
}

wire::PlainHeader Messages::header_of(TimePoint now, const peers::Peer& peer,
                                      const SendOptions& options) {
  wire::PlainHeader header;
  header.id = next_id(now, peer);
  header.deadline_us = wire::to_us(options.deadline);
  header.t0 = as_wire(now);
  header.channel = options.channel;
  header.importance = options.bulk ? 0 : options.importance;
  header.newest_only = options.newest_only;
  if (options.in_order_within > Duration::zero()) {
    header.order = {back_to_last(peer.identity().id, options.channel, header.id),
                    wire::to_us(options.in_order_within)};
  }
  if (options.needs != Needs{}) header.needs = dispatch::on_wire(options.needs);
  return header;
}

// The peer may remember identifiers of this session from before it was forgotten here, and would
// take smaller ones for old: so they begin at the milliseconds of our life so far, and more than
// that are not sent to one peer on average.
std::uint32_t Messages::next_id(TimePoint now, const peers::Peer& peer) {
  const Duration life = now - peer.identity().started;
  const auto begin = std::chrono::floor<std::chrono::milliseconds>(life).count();
  return next_ids_.try_emplace(peer.identity().id, static_cast<std::uint32_t>(begin))
      .first->second++;
}

// How far back the last message of this ordered channel lies; 0 where there is none that anybody
// remembers.
std::uint16_t Messages::back_to_last(PeerId peer, std::uint16_t channel, std::uint32_t id) {
  auto& channels = last_ordered_[peer];
  const auto known = channels.find(channel);
  const std::uint32_t back = known == channels.end() ? 0 : id - known->second;
  if (known == channels.end() && channels.size() >= ReceivedMessages::kMaxChannels) {
    channels.erase(
        std::ranges::max_element(channels, {}, [id](const auto& of) { return id - of.second; }));
  }
  channels[channel] = id;
  return back > UINT16_MAX ? std::uint16_t{0} : static_cast<std::uint16_t>(back);
}

// Whether the message may be sent, and by which routes.
SendResult Messages::plan(TimePoint now, peers::Peer& peer, const Policy& policy,
                          const Links& links, std::span<const std::size_t> sizes,
                          const SendOptions& options, dispatch::Routes& routes) const {
  if (std::ranges::none_of(links, &LinkState::up)) return {SendStatus::kNoLink};
  const QoS qos = qos_of(options);
  const Plan plan =
      plan::plan_message(policy, {qos, sizes}, links, {.time_left = options.deadline});
  const dispatch::Itinerary planned(plan);
  dispatch::seek_rate(now, peer, plan, planned, qos, sizes.front());
  if (planned.empty()) {
    const bool allowed = std::ranges::any_of(
        links, [&policy](const LinkState& l) { return l.up && policy.allows(l); });
    return {.status = allowed ? SendStatus::kPolicyRefuses : SendStatus::kLinkRestricted,
            .reason = plan.refused};
  }
  routes = dispatch::routes_of(now, peer, planned, dispatch::allowed_of(policy, links), links,
                               sizes, options);
  if (routes.itinerary.empty()) {
    peer.want(now, plan::rate_wanted(qos, sizes.front()));
    return {.status = SendStatus::kCannotArrive, .expected = routes.expected};
  }
  const std::size_t bytes = routes.itinerary.bytes(sizes, wire::MessageKind::kPlain);
  if (!sent_.has_room(peer.identity().id) || bytes > peers_.send_room(peer.identity().id)) {
    return {SendStatus::kOverBudget};
  }
  return {.status = SendStatus::kAccepted, .expected = routes.expected};
}

// A newer message of the channel is about to be sent: what has not left of the others need not.
void Messages::supersede(TimePoint now, PeerId to, std::uint16_t channel) {
  peers::Peer* peer = peers_.access(now, to);
  for (const SendId id : sent_.to(to)) {
    const SentMessages::Entry& entry = *sent_.find(id);
    if (!entry.newest_only || entry.channel != channel) continue;
    const bool left = std::ranges::any_of(entry.variants, [peer](const auto& v) {
      return !peer->sender().is_surely_incomplete(v.message);
    });
    if (left) continue;
    stop(*peer, entry);
    report(sent_.end(id, Fate::kDropped, FateReason::kSuperseded));
  }
}

bool Messages::cancel(TimePoint now, SendId id) {
  const SentMessages::Entry* entry = sent_.find(id);
  if (entry == nullptr) return false;
  if (peers::Peer* peer = peers_.access(now, entry->peer)) stop(*peer, *entry);
  report(sent_.end(id, Fate::kDropped, FateReason::kCancelled));
  return true;
}

void Messages::stop(peers::Peer& peer, const SentMessages::Entry& entry) {
  for (const SentMessages::Variant& v : entry.variants) peer.sender().cancel(v.message);
}

// --- what can send again

void Messages::wait(const Waiting& channel) {
  std::erase_if(waiting_, [&channel](const Waiting& w) {
    return w.peer == channel.peer && w.options.channel == channel.options.channel;
  });
  if (waiting_.size() >= kMaxWaiting) waiting_.erase(waiting_.begin());
  waiting_.push_back(channel);
  if (!recheck_at_) recheck_at_ = channel.since + kRecheck;
}

// By the same decision as send().
bool Messages::would_accept(TimePoint now, const Waiting& waiting) {
  peers::Peer* peer = peers_.access(now, waiting.peer);
  if (peer == nullptr) return false;
  dispatch::Routes routes;
  const Floored policy(*policies_.find(waiting.options.policy), waiting.options.needs.min_security);
  return plan(now, *peer, policy, peer->links(now), waiting.sizes, waiting.options, routes)
      .accepted();
}

// --- fates

void Messages::collect(TimePoint now, peers::Peer& peer) {
  while (const auto settled = peer.poll_settled()) settle(now, peer, *settled);
}

void Messages::collect(TimePoint now, std::span<const PeerId> peers) {
  for (const PeerId id : peers) {
    if (peers::Peer* peer = peers_.access(now, id)) collect(now, *peer);
  }
}

void Messages::settle(TimePoint now, peers::Peer& peer, const peers::Settled& settled) {
  const PeerId id = peer.identity().id;
  const SentMessages::Entry* entry = sent_.find(id, settled.message);
  if (entry == nullptr) return;
  using Kind = peers::Settled::Kind;
  // Without the peer's clock it may have been complete at any time since it left.
  SentMessages::When when{now - entry->t0, now - entry->t0};
  const auto clock = peer.clock(now);
  if (clock && settled.complete_at) {
    const std::int64_t at =
        wrapping_add(settled.complete_at->time_since_epoch().count(), clock->alpha);
    // The peer's word, and whatever it says it cannot have been there sooner or later than this.
    when.age = std::clamp(Duration{wrapping_sub(at, entry->t0.time_since_epoch().count())},
                          Duration::zero(), now - entry->t0);
    when.error = clock->rtt_min / 2;
  }
  switch (settled.kind) {
    case Kind::kComplete:
      // The other variants would only take room from messages that still count.
      stop(peer, *entry);
      return report(sent_.delivered(id, settled.message, when));
    case Kind::kKept:
      return note_kept(peer, *entry, settled.message, when);
    case Kind::kGivenUp:
      peer.want(now, entry->wanted);
      return report(sent_.dropped(id, settled.message, FateReason::kCannotArrive));
    case Kind::kIncomplete:
      return report(sent_.dropped(id, settled.message, FateReason::kExpired));
    case Kind::kDroppedThere:
      // Only one of a channel of which the newest counts, or order, is dropped while it is in time.
      if ((entry->newest_only || entry->in_order) &&
          when.age + when.error <= entry->deadline - entry->t0) {
        return report(sent_.dropped(id, settled.message, FateReason::kSuperseded));
      }
      return report(sent_.late(id, settled.message, when));
    case Kind::kRefused: {
      peer.sender().cancel(settled.message);
      // The peer names in one list what found no room and what it has waited for in vain.
      const bool is_over = now >= entry->deadline;
      return report(sent_.dropped(id, settled.message,
                                  is_over ? FateReason::kExpired : FateReason::kRefusedByPeer));
    }
  }
}

// The peer has a variant in time and waits for a better one: that it will be delivered is known,
// and only in which variant is not. Those that are no better would only take room.
void Messages::note_kept(peers::Peer& peer, const SentMessages::Entry& entry, MessageId message,
                         const SentMessages::When& when) {
  const auto kept = std::ranges::find(entry.variants, message, &SentMessages::Variant::message);
  for (const SentMessages::Variant& v : entry.variants) {
    if (v.variant > kept->variant) peer.sender().cancel(v.message);
  }
  forecasts_.settled(
      {.id = *sent_.id_of(entry.peer, message), .fate = Fate::kDelivered, .age = when.age});
}

void Messages::report(std::optional<MessageFate> fate) {
  if (!fate) return;
  forecasts_.settled(*fate);
  events_.emplace_back(*fate);
}

void Messages::expire(TimePoint now) {
  inbox_.expire(now);
  while (const auto id = sent_.ended(now)) {
    report(sent_.end(*id, Fate::kUnknown, FateReason::kExpired));
  }
  if (!recheck_at_ || *recheck_at_ > now) return;
  std::erase_if(waiting_, [this, now](const Waiting& w) {
    const bool again = would_accept(now, w);
    if (again) events_.emplace_back(CanSend{w.peer, w.options.channel});
    return again || now - w.since >= kLongestWait || peers_.access(now, w.peer) == nullptr;
  });
  recheck_at_.reset();
  if (!waiting_.empty()) recheck_at_ = now + kRecheck;
}

std::optional<TimePoint> Messages::next_timeout() const {
  return earliest(inbox_.next_timeout(), sent_.first_end(), recheck_at_);
}

void Messages::forget(PeerId peer) {
  next_ids_.erase(peer);
  last_ordered_.erase(peer);
  inbox_.forget(peer);
  for (const SendId id : sent_.to(peer)) {
    report(sent_.end(id, Fate::kUnknown, FateReason::kPeerGone));
  }
  forecasts_.forget(peer);
}

}  // namespace interneuron::messages
