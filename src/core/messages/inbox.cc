#include "core/messages/inbox.h"

#include <algorithm>

namespace interneuron::messages {

std::optional<Inbox::Age> Inbox::age_of(TimePoint now, peers::Peer& peer,
                                        const wire::PlainHeader& header) {
  const auto clock = peer.clock(now);
  if (!clock) return std::nullopt;
  const Duration theta = elapsed_across(header.t0, now);
  return Age{Duration{wrapping_sub(theta.count(), clock->alpha)}, clock->rtt_min / 2};
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
  if (keep(now, peer, age, arrived)) return;
  hand_over(now, peer, std::move(arrived));
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
  const Duration left = std::min(header.deadline(), limits_.longest_deadline) - age->age;
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
  } else if (verdict != Verdict::kDeliver) {
    ++counters_.messages_superseded;
  } else {
    // A worse variant has waited for this one.
    const auto worse = kept_.find({arrived.from, arrived.header.id});
    if (worse != kept_.end()) take(worse);
    events_.emplace_back(Message{arrived.from, arrived.header.channel, arrived.header.importance,
                                 arrived.header.variant,
                                 age ? std::optional(age->age) : std::nullopt,
                                 age ? age->error : Duration{}, std::move(arrived.payload)});
  }
}

void Inbox::expire(TimePoint now) {
  while (!due_.empty() && due_.begin()->first <= now) {
    Arrived arrived = take(kept_.find(due_.begin()->second));
    peers::Peer* peer = peers_.access(now, arrived.from);
    if (peer != nullptr) hand_over(now, *peer, std::move(arrived));
  }
}

std::optional<TimePoint> Inbox::next_timeout() const {
  if (due_.empty()) return std::nullopt;
  return due_.begin()->first;
}

void Inbox::forget(PeerId peer) {
  received_.forget(peer);
  for (auto it = kept_.lower_bound({peer, 0}); it != kept_.end() && it->first.first == peer;) {
    take(it++);
  }
}

}  // namespace interneuron::messages
