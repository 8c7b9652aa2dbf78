#include "node/loop/outbox.h"

#include <algorithm>
#include <utility>

#include "core/base/earliest.h"

namespace interneuron {

void Outbox::add(LinkId link, Transport& transport) {
  Link& added = links_.emplace_back();
  added.id = link;
  added.transport = &transport;
  added.slots.resize(kQueueDatagrams);
  for (Slot& slot : added.slots) slot.buffer = std::make_unique<Buffer>();
}

void Outbox::remove(LinkId link) {
  std::erase_if(links_, [link](const Link& known) { return known.id == link; });
}

Outbox::Link* Outbox::find(LinkId link) {
  const auto it = std::ranges::find(links_, link, &Link::id);
  return it == links_.end() ? nullptr : &*it;
}

const Outbox::Link* Outbox::find(LinkId link) const {
  return const_cast<Outbox*>(this)->find(link);
}

// Puts the datagram, which is in the spare buffer, at the end of the link's queue. In a full queue
// the oldest one makes room and is counted as stalled.
void Outbox::push(TimePoint now, Link& link, const TransmitParts& transmit) {
  if (link.full()) drop_oldest(link);
  if (link.count == 0) link.progress_at = now;
  Slot& slot = link.slots[(link.first + link.count) % link.slots.size()];
  slot.buffer.swap(spare_);
  slot.head = transmit.head;
  slot.payload = transmit.payload;
  slot.tail = transmit.tail;
  slot.to = transmit.to;
  slot.ecn = transmit.ecn;
  slot.round = transmit.round;
  ++link.count;
}

// Sends as much of the link's queue as its transport takes.
void Outbox::flush(TimePoint now, Link& link) {
  while (!link.blocked && link.pending() && now >= link.retry_at) {
    const BatchResult result = offer(link);
    link.first = (link.first + result.taken) % link.slots.size();
    link.count -= result.taken;
    if (result.gone != 0) link.gone = result.gone;
    link.blocked = result.would_block;
    if (result.taken > 0) link.progress_at = now;
    if (result.taken > 0 || !result.refused) link.refused_since.reset();
    link.held = result.refused && link.count == 0;
    if (!result.refused) return;
    if (!link.refused_since) link.refused_since = now;
    // What the transport holds is not here to be dropped.
    if (link.held || now - *link.refused_since < kStallPatience) {
      link.retry_at = now + kRefusedRetry;
      return;
    }
    drop_oldest(link);
  }
}

BatchResult Outbox::offer(const Link& link) {
  for (std::size_t i = 0; i < link.count; ++i) {
    const Slot& slot = link.slots[(link.first + i) % link.slots.size()];
    const ByteView own(*slot.buffer);
    batch_[i] = {slot.to,      own.first(slot.head),
                 slot.payload, own.subspan(slot.head, slot.tail),
                 slot.ecn,     slot.round};
  }
  return link.transport->send(std::span(batch_).first(link.count));
}

void Outbox::drop_oldest(Link& link) {
  link.first = (link.first + 1) % link.slots.size();
  --link.count;
  ++link.stalled;
}

// Whether some link's queue is full, but not yet for as long as kStallPatience.
bool Outbox::must_pause(TimePoint now) {
  for (Link& link : links_) {
    if (!link.full()) continue;
    flush(now, link);
    if (link.full() && now < link.patience_ends()) return true;
  }
  return false;
}

Outbox::More Outbox::pump(TimePoint now, Source& source) {
  const More more = gather(now, source);
  for (Link& link : links_) flush(now, link);
  keep_payloads();
  return more;
}

Outbox::More Outbox::collect(TimePoint now, Source& source) {
  const More more = gather(now, source);
  keep_payloads();
  return more;
}

// What has not left outlives the messages that it is part of.
void Outbox::keep_payloads() {
  for (Link& link : links_) {
    for (std::size_t i = 0; i < link.count; ++i) {
      Slot& slot = link.slots[(link.first + i) % link.slots.size()];
      if (slot.payload.empty()) continue;
      const TransmitParts parts{link.id, slot.to, slot.head, slot.payload, slot.tail};
      slot.head = parts.join(*slot.buffer).size;
      slot.payload = {};
      slot.tail = 0;
    }
  }
}

Outbox::More Outbox::gather(TimePoint now, Source& source) {
  for (std::size_t budget = kDatagramsPerTurn; budget > 0; --budget) {
    if (must_pause(now)) return More::kBlocked;
    const auto transmit = source.poll(now, *spare_);
    if (!transmit) return More::kNo;
    if (Link* link = find(transmit->link)) push(now, *link, *transmit);
  }
  return More::kNow;
}

void Outbox::writable(TimePoint now, LinkId id) {
  Link* link = find(id);
  if (link == nullptr) return;
  link->blocked = false;
  flush(now, *link);
}

bool Outbox::blocked(LinkId id) const {
  const Link* link = find(id);
  return link != nullptr && link->blocked;
}

std::optional<TimePoint> Outbox::next_timeout(TimePoint now) const {
  std::optional<TimePoint> next;
  for (const Link& link : links_) {
    if (link.full() && link.patience_ends() > now) next = earliest(next, link.patience_ends());
    if (!link.pending() || !link.refused_since || link.blocked) continue;
    // Its instant may have passed since the last pump(), but it must not be forgotten for that.
    next = earliest(next, link.retry_at > now ? link.retry_at : now + kRefusedRetry);
  }
  return next;
}

std::vector<std::pair<LinkId, int>> Outbox::take_gone() {
  std::vector<std::pair<LinkId, int>> out;
  for (Link& link : links_) {
    if (link.gone != 0) out.emplace_back(link.id, std::exchange(link.gone, 0));
  }
  return out;
}

std::size_t Outbox::queued(LinkId id) const {
  const Link* link = find(id);
  return link == nullptr ? 0 : link->count;
}

std::uint64_t Outbox::stalled(LinkId id) const {
  const Link* link = find(id);
  return link == nullptr ? 0 : link->stalled;
}

}  // namespace interneuron
