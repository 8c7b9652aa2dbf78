#include "core/messages/inbox.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/dispatch/dispatch.h"

namespace interneuron::messages {

std::optional<Inbox::Age> Inbox::age_of(TimePoint now, peers::Peer& peer,
                                        const wire::PlainHeader& header) {
  const auto clock = peer.clock(now);
  if (!clock) return std::nullopt;
  const Duration theta = elapsed_across(header.t0, now);
  // Nothing arrives before it set out: the estimate of the clock errs, or the peer's word is false,
  // which must not lengthen the time for which a message may be held.
  const Duration age{wrapping_sub(theta.count(), clock->alpha)};
  return Age{std::max(age, Duration{}), clock->rtt_min / 2};
}

void Inbox::complete(TimePoint now, peers::Peer& peer, MessageId message,
                     wire::MessageBytes bytes) {
  const auto header = wire::parse_plain_header(bytes.header_view());
  if (!header || bytes.payload.empty()) {
    ++counters_.bad_messages;
    return;
  }
  ++counters_.messages_completed;
  Arrived arrived{peer.identity().id, message, *header, std::move(bytes.payload), now};
  const auto age = age_of(now, peer, *header);
  if (!keep(now, peer, age, arrived)) settle(now, peer, std::move(arrived));
}

// Hands a message over, and those that have waited for it; or puts it where it waits for others.
void Inbox::settle(TimePoint now, peers::Peer& peer, Arrived arrived) {
  if (!arrived.header.order) {
    hand_over(now, peer, std::move(arrived));
    return;
  }
  const Channel channel{arrived.from, arrived.header.channel};
  const std::uint32_t id = arrived.header.id;
  const auto age = age_of(now, peer, arrived.header);
  const auto verdict =
      received_.look(arrived.from, arrived.header, age ? std::optional(age->age) : std::nullopt);
  if (verdict == ReceivedMessages::Verdict::kDeliver && must_wait(arrived)) {
    if (queue(now, peer, age, arrived)) return;
    // It may not wait: what is before it goes first, and what is missing is passed over.
    release(now, peer, channel, id);
  }
  hand_over(now, peer, std::move(arrived));
  release(now, peer, channel, std::nullopt);
}

// Keeps what awaits a better variant, in place of a worse one that is kept. False: it is to be
// handed over now, or is not wanted.
bool Inbox::keep(TimePoint now, peers::Peer& peer, const std::optional<Age>& age,
                 Arrived& arrived) {
  const wire::PlainHeader& header = arrived.header;
  if (!header.awaits_better || !age) return false;
  if (received_.look(arrived.from, header, age->age) != ReceivedMessages::Verdict::kDeliver) {
    return false;
  }
  const Key key{arrived.from, header.id};
  const auto worse = kept_.find(key);
  if (worse != kept_.end()) {
    if (worse->second.header.variant <= header.variant) {
      ++counters_.messages_superseded;
      return true;
    }
    take(worse);
  }
  Duration left = std::min(header.deadline(), limits_.longest_deadline) - age->age;
  // Of an ordered channel none waits for longer than those that wait for others.
  if (header.order) left = std::min(left, header.order->wait() + kHandOver);
  if (left <= kHandOver) return false;
  if (!memory_.has_room(arrived.from, arrived.payload.size(), limits_.held_messages)) {
    peer.strike(now, PeerLimit::kHeldMessages);
    return false;
  }
  memory_.add(arrived.from, arrived.payload.size());
  peer.intake().receipts.mark_kept(arrived.message);
  arrived.was_kept = true;
  arrived.until = now + left - kHandOver;
  due_.emplace(arrived.until, key);
  kept_.emplace(key, std::move(arrived));
  return true;
}

Inbox::Arrived Inbox::take(Kept::iterator it) {
  Arrived arrived = std::move(it->second);
  memory_.remove(arrived.from, arrived.payload.size());
  due_.erase({arrived.until, it->first});
  kept_.erase(it);
  return arrived;
}

// Whether the one before it in its channel may come yet.
bool Inbox::must_wait(const Arrived& arrived) const {
  const wire::PlainHeader& h = arrived.header;
  if (h.order->back == 0) return false;
  const auto newest = received_.newest(arrived.from, h.channel);
  return !newest || ReceivedMessages::ahead(h.id - h.order->back, *newest) > 0;
}

// Puts it where it waits in its channel. False: it may not wait.
bool Inbox::queue(TimePoint now, peers::Peer& peer, const std::optional<Age>& age,
                  Arrived& arrived) {
  const wire::PlainHeader& h = arrived.header;
  TimePoint until = saturating_add(arrived.at, std::min(h.order->wait(), limits_.longest_deadline));
  if (age) until = std::min(until, now + (h.deadline() - age->age - kHandOver));
  if (until <= now) return false;
  if (!memory_.has_room(arrived.from, arrived.payload.size(), limits_.ordered_messages,
                        HeldMemory::For::kOrder)) {
    peer.strike(now, PeerLimit::kHeldMessages);
    return false;
  }
  const Channel channel{arrived.from, h.channel};
  Queue& waiting = queues_[channel];
  auto place = waiting.end();
  while (place != waiting.begin() &&
         ReceivedMessages::ahead(std::prev(place)->header.id, h.id) >= 0) {
    --place;
  }
  if (place != waiting.end() && place->header.id == h.id) {
    ++counters_.messages_superseded;
    return true;
  }
  memory_.add(arrived.from, arrived.payload.size(), HeldMemory::For::kOrder);
  arrived.until = until;
  queues_due_.insert({until, channel, h.id});
  waiting.insert(place, std::move(arrived));
  return true;
}

Inbox::Arrived Inbox::take_first(const Channel& channel, Queue& queue) {
  Arrived first = std::move(queue.front());
  queue.pop_front();
  memory_.remove(first.from, first.payload.size(), HeldMemory::For::kOrder);
  queues_due_.erase({first.until, channel, first.header.id});
  return first;
}

// Hands over what waits in a channel up to this message, and then what need not wait any more.
void Inbox::release(TimePoint now, peers::Peer& peer, const Channel& channel,
                    std::optional<std::uint32_t> up_to) {
  const auto it = queues_.find(channel);
  if (it == queues_.end()) return;
  Queue& waiting = it->second;
  while (!waiting.empty()) {
    const bool is_due = up_to && ReceivedMessages::ahead(waiting.front().header.id, *up_to) <= 0;
    if (!is_due && must_wait(waiting.front())) break;
    hand_over(now, peer, take_first(channel, waiting));
  }
  if (waiting.empty()) queues_.erase(it);
}

void Inbox::hand_over(TimePoint now, peers::Peer& peer, Arrived arrived) {
  using Verdict = ReceivedMessages::Verdict;
  const auto age = age_of(now, peer, arrived.header);
  const Verdict verdict =
      received_.judge(arrived.from, arrived.header, age ? std::optional(age->age) : std::nullopt);
  const bool dropped = verdict != Verdict::kDeliver && verdict != Verdict::kRepeated;
  if (arrived.was_kept) {
    peer.intake().receipts.settle_kept(arrived.message, arrived.at, dropped);
    peer.intake().feedback.has_news(now);
  } else if (dropped) {
    peer.mark_dropped(arrived.message);
  }
  if (verdict == Verdict::kLate) {
    ++counters_.messages_late;
    if (arrived.header.order && !must_wait(arrived)) received_.pass(arrived.from, arrived.header);
  } else if (verdict != Verdict::kDeliver) {
    ++counters_.messages_superseded;
  } else {
    // A worse variant has waited for this one.
    const auto worse = kept_.find({arrived.from, arrived.header.id});
    if (worse != kept_.end()) take(worse);
    events_.emplace_back(Message{
        arrived.from, arrived.header.channel, arrived.header.importance, arrived.header.variant,
        age ? std::optional(age->age) : std::nullopt, age ? age->error : Duration{},
        dispatch::needs_of(arrived.header), std::move(arrived.payload)});
  }
}

void Inbox::expire(TimePoint now) {
  while (!due_.empty() && due_.begin()->first <= now) {
    Arrived arrived = take(kept_.find(due_.begin()->second));
    peers::Peer* peer = peers_.access(now, arrived.from);
    if (peer != nullptr) settle(now, *peer, std::move(arrived));
  }
  while (!queues_due_.empty() && queues_due_.begin()->until <= now) {
    const QueueDue due = *queues_due_.begin();
    peers::Peer* peer = peers_.access(now, due.channel.first);
    if (peer == nullptr) {
      forget(due.channel.first);
    } else {
      release(now, *peer, due.channel, due.id);
    }
  }
}

std::optional<TimePoint> Inbox::next_timeout() const {
  std::optional<TimePoint> next;
  if (!due_.empty()) next = due_.begin()->first;
  if (!queues_due_.empty()) next = earliest(next, queues_due_.begin()->until);
  return next;
}

void Inbox::forget(PeerId peer) {
  received_.forget(peer);
  for (auto it = kept_.lower_bound({peer, 0}); it != kept_.end() && it->first.first == peer;) {
    take(it++);
  }
  for (auto it = queues_.lower_bound({peer, 0}); it != queues_.end() && it->first.first == peer;) {
    while (!it->second.empty()) take_first(it->first, it->second);
    it = queues_.erase(it);
  }
}

}  // namespace interneuron::messages
