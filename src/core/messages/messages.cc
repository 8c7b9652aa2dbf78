#include "core/messages/messages.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/base/earliest.h"
#include "core/messages/routes.h"
#include "core/plan/carriers.h"
#include "core/plan/plan_message.h"
#include "core/wire/plain_header.h"
#include "interneuron/sizes.h"

namespace interneuron {
namespace {

// How long beyond a round trip after the deadline a fate is waited for (send.h). Feedback comes
// 5 ms after a message at the latest (src/core/peers/feedback_due.h), so that several may be lost.
constexpr Duration kGrace = std::chrono::milliseconds(50);
// How often channels that were refused are looked at again, and senders asked what they have given
// up. No measurement behind this value: it only has to be short against the deadlines of messages.
constexpr Duration kLookAgain = std::chrono::milliseconds(10);
// Longer than this a fate is not waited for beyond the deadline, whatever round-trip time the peer
// makes us measure. No measurement behind it: cellular links with full queues take some hundred
// milliseconds.
constexpr Duration kLongestRoundTrip = std::chrono::seconds(2);
// A channel that could not send again for so long is not told any more. No measurement behind this
// value: an application that still wants to send has asked again long since.
constexpr Duration kLongestWait = std::chrono::seconds(10);

wire::MessageBytes with(const wire::PlainHeader& header, Bytes payload) {
  std::array<std::byte, wire::kPlainHeaderBytes> bytes;
  wire::write_plain_header(bytes, header);
  return {bytes, std::move(payload)};
}

std::uint32_t to_us(Duration d) {
  return static_cast<std::uint32_t>(
      std::chrono::ceil<std::chrono::microseconds>(std::min(d, kLongestDeadline)).count());
}

flow::PathSet allowed_of(const Policy& policy, std::span<const LinkState> links) {
  flow::PathSet allowed;
  for (const LinkState& link : links) {
    if (policy.allows(link)) allowed.add(link.id);
  }
  return allowed;
}

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

// The rate that brings the best variant within half of its time; the other half is for the way and
// for queues.
DataRate rate_wanted(std::span<const std::size_t> sizes, Duration deadline) {
  return rate_of(wire_size(sizes.front()), deadline / 2);
}

Few<std::size_t, kMaxVariants> sizes_of(const Variants& variants) {
  Few<std::size_t, kMaxVariants> sizes;
  for (const Bytes& variant : variants) sizes.push_back(variant.size());
  return sizes;
}

const LinkState& find(std::span<const LinkState> links, LinkId id) {
  return *std::ranges::find(links, id, &LinkState::id);
}

}  // namespace

Messages::Messages(const PolicySet& policies, Peers& peers, std::deque<Event>& events)
    : peers_(peers), events_(events) {
  for (const auto& policy : policies) policies_.emplace(policy->name(), policy);
}

const Policy& Messages::rule(const std::string& name) const {
  const auto it = policies_.find(name);
  if (it == policies_.end()) {
    throw std::invalid_argument("send: policy '" + name + "' is not registered");
  }
  return *it->second;
}

// --- sending

SendResult Messages::send(TimePoint now, PeerId to, Variants variants, const SendOptions& asked) {
  SendOptions options = asked;
  options.deadline = std::min(options.deadline, kLongestDeadline);
  const Policy& policy = rule(options.policy);
  if (const auto wrong = fault(variants, options)) return {*wrong};
  Peer* peer = peers_.find(now, to);
  if (peer == nullptr) return {SendStatus::kNoPeer};
  const Sizes sizes = sizes_of(variants);
  Routes routes;
  SendResult result = plan(now, *peer, sizes, options, routes);
  const auto may_change = {SendStatus::kNoLink, SendStatus::kCannotArrive, SendStatus::kOverBudget};
  if (std::ranges::find(may_change, result.status) != may_change.end()) {
    wait({to, sizes, options, now});
  }
  if (!result.accepted()) return result;

  if (options.newest_only) supersede(now, to, options.channel);
  const Duration deadline = options.deadline;
  wire::PlainHeader header;
  header.id = next_id(now, *peer);
  header.deadline_us = to_us(deadline);
  header.t0 = as_wire(now);
  header.channel = options.channel;
  header.importance = options.importance;
  header.newest_only = options.newest_only;
  const Links links = peer->links(now);
  SentMessages::Entry entry{.peer = to,
                            .channel = options.channel,
                            .newest_only = options.newest_only,
                            .t0 = now,
                            .deadline = now + deadline,
                            .ends = now + deadline + kGrace,
                            .wanted = rate_wanted({sizes.data(), sizes.size()}, deadline)};
  Duration round_trip{};
  for (const Route& route : routes.routes) {
    header.variant = route.variant;
    const MessageId message = peer->send(
        now, {.deadline = entry.deadline, .lifetime = deadline, .importance = options.importance},
        with(header, std::move(variants[route.variant])), route.links, allowed_of(policy, links),
        wire::MessageKind::kPlain,
        {route.divided, flow::PathSet::of(route.parity), flow::PathSet::of(route.shadow)});
    entry.variants.push_back({message, route.variant});
    for (const LinkId id : route.links) {
      round_trip = std::max(round_trip, find(links, id).rtt_p50);
    }
  }
  for (std::size_t v = 0; v < variants.size(); ++v) {
    if (!routes.standing_by(v)) continue;
    header.variant = static_cast<std::uint8_t>(v);
    const MessageId message =
        peer->add_alternative(now, entry.variants.back().message,
                              with(header, std::move(variants[v])), routes.shadow_of(v));
    entry.variants.push_back({message, header.variant});
  }
  entry.ends += std::min(round_trip, kLongestRoundTrip);
  result.id = sent_.add(entry);
  forecasts_.sent(result.id, routes.outlook, routes.on_time);
  if (!collect_at_) collect_at_ = now + kLookAgain;
  return result;
}

// The peer may remember identifiers of this session from before it was forgotten here, and would
// take smaller ones for old: so they begin at the milliseconds of our life so far, and more than
// that are not sent to one peer on average.
std::uint32_t Messages::next_id(TimePoint now, const Peer& peer) {
  const Duration life = now - peer.identity().started;
  const auto begin = std::chrono::floor<std::chrono::milliseconds>(life).count();
  return next_ids_.try_emplace(peer.identity().id, static_cast<std::uint32_t>(begin))
      .first->second++;
}

// Whether the message may be sent, and by which routes.
SendResult Messages::plan(TimePoint now, Peer& peer, const Sizes& sizes, const SendOptions& options,
                          Routes& routes) const {
  const Policy& policy = rule(options.policy);
  const Links links = peer.links(now);
  if (std::ranges::none_of(links, &LinkState::up)) return {SendStatus::kNoLink};
  QoS qos{.deadline = options.deadline};
  qos.needs.delay = 1.0;
  const std::span<const std::size_t> span(sizes.data(), sizes.size());
  const Plan plan = plan_message(policy, {qos, span}, links, {.time_left = options.deadline});
  const bool best_is_sent = !plan.sends.empty() && best_planned(plan) == 0;
  if (!best_is_sent || plan.under_floor) peer.want(now, rate_wanted(span, options.deadline));
  if (plan.sends.empty()) {
    const bool allowed = std::ranges::any_of(
        links, [&policy](const LinkState& l) { return l.up && policy.allows(l); });
    return {.status = allowed ? SendStatus::kPolicyRefuses : SendStatus::kLinkRestricted,
            .reason = plan.refused};
  }
  routes = routes_of(now, peer, plan, links, span, options.deadline, options.importance);
  const double on_time = routes.on_time = forecasts_.predict(routes.outlook);
  if (routes.routes.empty()) {
    peer.want(now, rate_wanted(span, options.deadline));
    return {.status = SendStatus::kCannotArrive, .expected = routes.expected, .on_time = on_time};
  }
  const std::size_t bytes = routes.bytes(span);
  if (!sent_.has_room(peer.identity().id) || bytes > peers_.send_room(peer.identity().id)) {
    return {SendStatus::kOverBudget};
  }
  return {.status = SendStatus::kAccepted, .expected = routes.expected, .on_time = on_time};
}

// A newer message of the channel is about to be sent: what has not left of the others need not.
void Messages::supersede(TimePoint now, PeerId to, std::uint16_t channel) {
  Peer* peer = peers_.find(now, to);
  for (const SendId id : sent_.to(to)) {
    const SentMessages::Entry& entry = *sent_.find(id);
    if (!entry.newest_only || entry.channel != channel) continue;
    const bool left = std::ranges::any_of(
        entry.variants, [peer](const auto& v) { return !peer->is_surely_incomplete(v.message); });
    if (left) continue;
    stop(*peer, entry);
    tell(sent_.end(id, Fate::kDropped, FateReason::kSuperseded));
  }
}

bool Messages::cancel(TimePoint now, SendId id) {
  const SentMessages::Entry* entry = sent_.find(id);
  if (entry == nullptr) return false;
  if (Peer* peer = peers_.find(now, entry->peer)) stop(*peer, *entry);
  tell(sent_.end(id, Fate::kDropped, FateReason::kCancelled));
  return true;
}

void Messages::stop(Peer& peer, const SentMessages::Entry& entry) {
  for (const SentMessages::Variant& v : entry.variants) peer.cancel(v.message);
}

// --- what can send again

void Messages::wait(const Waiting& channel) {
  std::erase_if(waiting_, [&channel](const Waiting& w) {
    return w.peer == channel.peer && w.options.channel == channel.options.channel;
  });
  if (waiting_.size() >= kMaxWaiting) waiting_.erase(waiting_.begin());
  waiting_.push_back(channel);
  if (!look_at_) look_at_ = channel.since + kLookAgain;
}

// By the same decision as send().
bool Messages::would_accept(TimePoint now, const Waiting& waiting) {
  Peer* peer = peers_.find(now, waiting.peer);
  Routes routes;
  return peer != nullptr && plan(now, *peer, waiting.sizes, waiting.options, routes).accepted();
}

// --- receiving

void Messages::complete(TimePoint now, Peer& peer, MessageId message, wire::MessageBytes bytes) {
  const auto header = wire::parse_plain_header(bytes.header_view());
  if (!header || bytes.payload.empty()) {
    ++counters_.bad_messages;
    return;
  }
  ++counters_.messages_completed;
  const PeerId from = peer.identity().id;
  std::optional<Duration> age;
  Duration error{};
  if (const auto clock = peer.clock(now)) {
    const Duration theta = elapsed_across(header->t0, now);
    age = Duration{wrapping_sub(theta.count(), clock->alpha)};
    error = clock->rtt_min / 2;
  }
  switch (received_.judge(from, *header, age)) {
    case ReceivedMessages::Verdict::kLate:
      ++counters_.messages_late;
      peer.mark_dropped(message);
      return;
    case ReceivedMessages::Verdict::kSuperseded:
    case ReceivedMessages::Verdict::kTooOld:
      ++counters_.messages_superseded;
      peer.mark_dropped(message);
      return;
    case ReceivedMessages::Verdict::kRepeated:
      ++counters_.messages_superseded;
      return;
    case ReceivedMessages::Verdict::kDeliver:
      events_.emplace_back(Message{from, header->channel, header->importance, header->variant, age,
                                   error, std::move(bytes.payload)});
  }
}

// --- fates

void Messages::collect(TimePoint now, Peer& peer) {
  while (const auto settled = peer.poll_settled()) settle(now, peer, *settled);
}

void Messages::settle(TimePoint now, Peer& peer, const Settled& settled) {
  const PeerId id = peer.identity().id;
  const SentMessages::Entry* entry = sent_.find(id, settled.message);
  if (entry == nullptr) return;
  using Kind = Settled::Kind;
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
      return tell(sent_.delivered(id, settled.message, when));
    case Kind::kGivenUp:
      peer.want(now, entry->wanted);
      return tell(sent_.dropped(id, settled.message, FateReason::kCannotArrive));
    case Kind::kIncomplete:
      return tell(sent_.dropped(id, settled.message, FateReason::kExpired));
    case Kind::kDroppedThere:
      // Only one of a channel of which the newest counts is dropped while it is in time.
      if (entry->newest_only && when.age + when.error <= entry->deadline - entry->t0) {
        return tell(sent_.dropped(id, settled.message, FateReason::kSuperseded));
      }
      return tell(sent_.late(id, settled.message, when));
    case Kind::kRefused: {
      peer.cancel(settled.message);
      // The peer names in one list what found no room and what it has waited for in vain.
      const bool is_over = now >= entry->deadline;
      return tell(sent_.dropped(id, settled.message,
                                is_over ? FateReason::kExpired : FateReason::kRefusedByPeer));
    }
  }
}

void Messages::tell(std::optional<MessageFate> fate) {
  if (!fate) return;
  forecasts_.settled(*fate);
  events_.emplace_back(*fate);
}

void Messages::expire(TimePoint now) {
  if (collect_at_ && *collect_at_ <= now) {
    sent_.peers(asked_);
    for (const PeerId id : asked_) {
      if (Peer* peer = peers_.find(now, id)) collect(now, *peer);
    }
    collect_at_ = now + kLookAgain;
  }
  if (!sent_.first_end()) collect_at_.reset();
  while (const auto id = sent_.ended(now)) {
    tell(sent_.end(*id, Fate::kUnknown, FateReason::kExpired));
  }
  if (!look_at_ || *look_at_ > now) return;
  std::erase_if(waiting_, [this, now](const Waiting& w) {
    const bool again = would_accept(now, w);
    if (again) events_.emplace_back(CanSend{w.peer, w.options.channel});
    return again || now - w.since >= kLongestWait || peers_.find(now, w.peer) == nullptr;
  });
  look_at_.reset();
  if (!waiting_.empty()) look_at_ = now + kLookAgain;
}

std::optional<TimePoint> Messages::next_timeout() const {
  return earliest(sent_.first_end(), look_at_, collect_at_);
}

void Messages::forget(PeerId peer) {
  next_ids_.erase(peer);
  received_.forget(peer);
  for (const SendId id : sent_.to(peer)) {
    tell(sent_.end(id, Fate::kUnknown, FateReason::kPeerGone));
  }
  forecasts_.forget(peer);
}

}  // namespace interneuron
