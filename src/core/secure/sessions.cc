#include "core/secure/sessions.h"

#include <algorithm>
#include <cassert>
#include <stdexcept>

namespace interneuron::crypto {
Sessions::Sessions(const Security& security, SessionId self, bool accept, TimePoint now)
    : security_(security),
      own_(key_pair_of(security.key)),
      self_(self),
      accept_(accept),
      started_(now),
      entropy_(security.seed),
      responder_(own_, self, security.peers) {
  if (security.key == SecretKey{}) throw std::invalid_argument("security: the key is zero");
  if (security.seed == SecretKey{}) throw std::invalid_argument("security: the seed is zero");
}

const TrustedPeer* Sessions::trusted(const PublicKey& who) const {
  const auto it = std::ranges::find(security_.peers, who, &TrustedPeer::key);
  return it == security_.peers.end() ? nullptr : &*it;
}

std::optional<PublicKey> Sessions::only_peer() const {
  if (security_.peers.size() != 1) return std::nullopt;
  return security_.peers.front().key;
}

Sessions::Held* Sessions::held(Owner owner) {
  return owner < held_.size() ? held_[owner].get() : nullptr;
}

const Sessions::Held* Sessions::held(Owner owner) const {
  return owner < held_.size() ? held_[owner].get() : nullptr;
}

Sessions::Slot* Sessions::slot(std::uint32_t index) {
  const auto it = slots_.find(index);
  return it == slots_.end() ? nullptr : &it->second;
}

const Sessions::Slot* Sessions::slot(std::uint32_t index) const {
  const auto it = slots_.find(index);
  return it == slots_.end() ? nullptr : &it->second;
}

std::uint32_t Sessions::draw_index() {
  std::uint32_t index = entropy_.draw_index();
  while (slots_.contains(index) || asking_.contains(index)) index = entropy_.draw_index();
  return index;
}

std::int64_t Sessions::time_of_day(TimePoint now) const {
  return std::max(said_ns_, security_.unix_time_ns + Duration(now - started_).count());
}

// Grows with every call, also where the clock does not.
std::int64_t Sessions::unix_ns(TimePoint now) {
  said_ns_ = std::max(said_ns_ + 1, time_of_day(now));
  return said_ns_;
}

Initiator::Fresh Sessions::fresh(TimePoint now) {
  return {draw_index(), entropy_.draw_key(), unix_ns(now)};
}

// --- peers

void Sessions::connect(TimePoint now, Owner owner, const PublicKey& who) {
  const TrustedPeer* const peer = trusted(who);
  assert(peer != nullptr);
  if (held_.size() <= owner) held_.resize(owner + 1);
  held_[owner] = std::make_unique<Held>();
  held_[owner]->who = who;
  held_[owner]->initiator.emplace(own_, *peer, self_);
  held_[owner]->initiator->begin(now);
}

void Sessions::adopt(Owner owner, std::uint32_t index) {
  Slot* const there = slot(index);
  assert(there != nullptr && !there->owner);
  if (held_.size() <= owner) held_.resize(owner + 1);
  held_[owner] = std::make_unique<Held>();
  held_[owner]->who = there->who;
  held_[owner]->current = index;
  there->owner = owner;
  unowned_.erase(there->who);
  std::erase(unowned_order_, index);
  adopted_[there->who] = owner;
}

void Sessions::remove(Owner owner) {
  Held* const gone = held(owner);
  if (gone == nullptr) return;
  for (std::uint32_t* index : {&gone->current, &gone->former, &gone->next}) drop(*index);
  if (gone->initiator) {
    asking_.erase(gone->initiator->index());
  } else {
    adopted_.erase(gone->who);
  }
  held_[owner].reset();
}

std::optional<Sessions::Owner> Sessions::owner_of(const PublicKey& who) const {
  const auto it = adopted_.find(who);
  return it == adopted_.end() ? std::nullopt : std::optional(it->second);
}

bool Sessions::is_open(TimePoint now, Owner owner) const {
  const Held* const peer = held(owner);
  const Slot* const there = peer == nullptr ? nullptr : slot(peer->current);
  return there != nullptr && !there->session.is_over(now);
}

void Sessions::set_silent(TimePoint now, Owner owner, bool is_silent) {
  Held* const peer = held(owner);
  if (peer == nullptr || !peer->initiator || !is_open(now, owner)) return;
  if (peer->is_silent == is_silent) return;
  peer->is_silent = is_silent;
  if (is_silent) {
    peer->initiator->begin(now);
  } else if (now < peer->rekey_at) {
    asking_.erase(peer->initiator->index());
    peer->initiator->stop();
  }
}

void Sessions::drop(std::uint32_t& index) {
  slots_.erase(index);
  index = 0;
}

void Sessions::promote(Held& peer, std::uint32_t index) {
  drop(peer.former);
  peer.former = peer.current;
  peer.current = index;
}

// --- what comes in

Sessions::Opened Sessions::open(TimePoint now, const wire::PacketHeader& header, ByteView packet,
                                std::span<std::byte> out) {
  Opened opened;
  Slot* const there = slot(header.session.value);
  if (there == nullptr || there->session.is_over(now)) return opened;
  opened.result = there->session.open(header, packet, out);
  if (opened.result != Session::Opened::kOk) return opened;
  opened.owner = there->owner;
  opened.who = there->who;
  opened.life = there->life;
  if (!there->owner) return opened;
  Held& peer = *held(*there->owner);
  // The other side has the new keys too.
  if (peer.next == header.session.value) {
    peer.next = 0;
    promote(peer, header.session.value);
  }
  return opened;
}

Sessions::Shaken Sessions::take_handshake(TimePoint now, const wire::PacketHeader& header,
                                          const Datagram& datagram) {
  Shaken out;
  if (header.type == wire::PacketType::kInitiation) {
    if (accept_) take_initiation(now, header, datagram, out);
    return out;
  }
  const auto asking = asking_.find(header.session.value);
  if (asking != asking_.end()) {
    const Owner owner = asking->second;
    if (header.type == wire::PacketType::kCookie) {
      out.is_used = held(owner)->initiator->take_cookie(header, datagram.bytes);
      return out;
    }
    take_response(now, owner, datagram.bytes, out);
    return out;
  }
  // An answer to a further copy of what was answered.
  if (header.type != wire::PacketType::kResponse) return out;
  const Slot* const there = slot(header.session.value);
  if (there == nullptr || !there->owner) return out;
  const Held& peer = *held(*there->owner);
  if (!peer.initiator) return out;
  out.token = peer.initiator->token_of(datagram.bytes);
  out.owner = *there->owner;
  out.is_used = out.token.has_value();
  return out;
}

void Sessions::take_initiation(TimePoint now, const wire::PacketHeader& header,
                               const Datagram& datagram, Shaken& out) {
  const Responder::Verdict verdict = responder_.take(now, header, datagram, entropy_);
  out.is_used = verdict == Responder::Verdict::kAnswered;
  if (verdict != Responder::Verdict::kNew) return;
  const Initiator::Fresh made = fresh(now);
  const auto accepted = responder_.accept(now, header, datagram, made);
  if (!accepted) return;
  out.is_used = true;
  const auto owner = owner_of(accepted->who);
  Held* const peer = owner ? held(*owner) : nullptr;
  const bool is_same_life = peer != nullptr && slot(peer->current) != nullptr &&
                            slot(peer->current)->life == accepted->theirs.life;
  Slot added(accepted->who, accepted->theirs.life,
             Session(now, Session::Role::kResponder, accepted->theirs.index, accepted->keys));
  if (is_same_life) added.owner = owner;
  slots_.emplace(made.index, std::move(added));
  if (is_same_life) {
    drop(peer->next);
    peer->next = made.index;
  } else {
    add_unowned(now, made.index);
  }
}

void Sessions::add_unowned(TimePoint now, std::uint32_t index) {
  std::uint32_t& newest = unowned_[slots_.at(index).who];
  if (newest != 0) {
    std::erase(unowned_order_, newest);
    drop(newest);
  }
  newest = index;
  unowned_order_.push_back(index);
  while (unowned_order_.size() > kMaxUnowned ||
         slots_.at(unowned_order_.front()).session.is_over(now)) {
    std::uint32_t oldest = unowned_order_.front();
    unowned_order_.pop_front();
    unowned_.erase(slots_.at(oldest).who);
    drop(oldest);
  }
}

void Sessions::take_response(TimePoint now, Owner owner, ByteView packet, Shaken& out) {
  Held& peer = *held(owner);
  const std::uint32_t index = peer.initiator->index();
  const auto answer = peer.initiator->take_response(packet);
  if (!answer) return;
  asking_.erase(index);
  // A host that does not know the time takes that of whom it trusts.
  const std::int64_t behind = answer->theirs.unix_ns - unix_ns(now);
  if (behind > 0) security_.unix_time_ns += behind;
  Slot added(peer.who, answer->theirs.life,
             Session(now, Session::Role::kInitiator, answer->theirs.index, answer->keys));
  added.owner = owner;
  slots_.emplace(index, std::move(added));
  const Slot* const before = slot(peer.current);
  const bool is_same_life = before != nullptr && before->life == answer->theirs.life;
  promote(peer, index);
  if (!is_same_life) drop(peer.former);
  peer.is_silent = false;
  peer.rekey_at =
      now + kRekeyAfter +
      Duration(static_cast<std::int64_t>(entropy_.draw_below(Duration(kRekeyJitter).count())));
  out.is_used = true;
  out.answered = owner;
  out.owner = owner;
  out.life = answer->theirs.life;
  out.token = peer.initiator->token_of(packet);
}

// --- what leaves

bool Sessions::seal(TimePoint now, Owner owner, std::span<std::byte> packet) {
  Held* const peer = held(owner);
  Slot* const there = peer == nullptr ? nullptr : slot(peer->current);
  if (there == nullptr || there->session.is_over(now)) return false;
  const bool sealed = there->session.seal(packet);
  if (there->session.wants_rekey() && peer->initiator) {
    peer->rekey_at = std::min(peer->rekey_at, there->session.born() + kBetweenRekeys);
  }
  return sealed;
}

bool Sessions::seal_control(TimePoint now, std::uint32_t index, std::span<std::byte> packet) {
  Slot* const there = slot(index);
  return there != nullptr && !there->session.is_over(now) && there->session.seal_control(packet);
}

bool Sessions::initiation_due(TimePoint now, Owner owner) {
  Held* const peer = held(owner);
  if (peer == nullptr || !peer->initiator || !peer->initiator->is_due(now)) return false;
  if (peer->initiator->needs_message(now)) {
    asking_.erase(peer->initiator->index());
    if (!peer->initiator->make_message(now, fresh(now))) return false;
    asking_[peer->initiator->index()] = owner;
  }
  return true;
}

std::size_t Sessions::write_initiation(Owner owner, LinkId path, std::span<std::byte> out) const {
  held(owner)->initiator->write(path, out);
  return kInitiationBytes;
}

void Sessions::initiation_sent(TimePoint now, Owner owner) { held(owner)->initiator->tried(now); }

// --- time

std::optional<TimePoint> Sessions::next_timeout(Owner owner) const {
  const Held* const peer = held(owner);
  if (peer == nullptr || !peer->initiator) return std::nullopt;
  const auto tries = peer->initiator->next_timeout();
  if (tries) return tries;
  return peer->rekey_at == TimePoint::max() ? std::nullopt : std::optional(peer->rekey_at);
}

void Sessions::handle_timeout(TimePoint now, Owner owner) {
  Held* const peer = held(owner);
  if (peer == nullptr) return;
  const Slot* const former = slot(peer->former);
  if (former != nullptr && former->session.is_over(now)) drop(peer->former);
  if (peer->initiator && now >= peer->rekey_at) peer->initiator->begin(now);
}

}  // namespace interneuron::crypto
