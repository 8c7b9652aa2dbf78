#include "core/secure/sessions.h"

#include <algorithm>
#include <cassert>
#include <stdexcept>

#include "core/base/earliest.h"

namespace interneuron::crypto {
Sessions::Sessions(const Security& security, SessionId self, bool accept, TimePoint now,
                   Ciphers ciphers, const Shard& shard)
    : credential_(security.credential),
      own_(key_pair_of(security.key)),
      self_(self),
      accept_(accept),
      ciphers_(ciphers),
      shard_(shard),
      time_of_day_(now, security.unix_time_ns),
      entropy_(security.seed),
      trust_(security),
      responder_(own_, self, trust_, shard) {
  if (security.key == SecretKey{}) throw std::invalid_argument("security: the key is zero");
  if (security.seed == SecretKey{}) throw std::invalid_argument("security: the seed is zero");
}

// What the other side says that it knows counts, but it may say in each handshake that it knows
// nothing.
bool Sessions::take_turn_to_tell(TimePoint now, Owner owner) {
  PeerKeys* const peer = held(owner);
  LiveSession* const there = peer == nullptr ? nullptr : live(peer->current);
  const std::int64_t newest = trust_.revocations_s();
  if (there == nullptr || there->revocations_s >= newest) return false;
  if (peer->told_s >= newest && now - peer->told_at < kBetweenLists) return false;
  there->revocations_s = peer->told_s = newest;
  peer->told_at = now;
  return true;
}

bool Sessions::is_revoked(Owner owner) const {
  const PeerKeys* const peer = held(owner);
  return peer != nullptr && trust_.is_revoked(peer->who);
}

PeerKeys* Sessions::held(Owner owner) {
  return owner < held_.size() ? held_[owner].get() : nullptr;
}

const PeerKeys* Sessions::held(Owner owner) const {
  return owner < held_.size() ? held_[owner].get() : nullptr;
}

LiveSession* Sessions::live(std::uint32_t index) {
  const auto it = live_.find(index);
  return it == live_.end() ? nullptr : &it->second;
}

const LiveSession* Sessions::live(std::uint32_t index) const {
  const auto it = live_.find(index);
  return it == live_.end() ? nullptr : &it->second;
}

std::uint32_t Sessions::draw_index() {
  std::uint32_t index = entropy_.draw_index(shard_);
  while (live_.contains(index) || asking_.contains(index)) index = entropy_.draw_index(shard_);
  return index;
}

bool Sessions::is_connected(const PublicKey& who) const {
  return std::ranges::any_of(
      held_, [&who](const auto& peer) { return peer && peer->initiator && peer->who == who; });
}

Initiator::Fresh Sessions::fresh(TimePoint now) {
  return {draw_index(), entropy_.draw_key(), time_of_day_.next_unix_ns(now), trust_.revocations_s(),
          ciphers_};
}

// --- peers

void Sessions::connect(TimePoint now, Owner owner, const PublicKey& who) {
  const auto shared = trust_.may_connect(who);
  assert(shared);
  if (held_.size() <= owner) held_.resize(owner + 1);
  held_[owner] = std::make_unique<PeerKeys>();
  held_[owner]->who = who;
  held_[owner]->initiator.emplace(own_, TrustedPeer{who, *shared}, self_, credential_);
  held_[owner]->initiator->begin(now);
}

void Sessions::adopt(Owner owner, std::uint32_t index) {
  LiveSession* const there = live(index);
  assert(there != nullptr && !there->owner);
  if (held_.size() <= owner) held_.resize(owner + 1);
  held_[owner] = std::make_unique<PeerKeys>();
  held_[owner]->who = there->who;
  held_[owner]->current = index;
  shared_keys_.note_life(there->session.born(), there->who, there->life);
  there->owner = owner;
  adopted_[there->who] = owner;
  std::erase(unowned_order_, index);
  Unowned& of_key = unowned_.at(there->who);
  if (of_key.former != index) drop_unowned(of_key.former);
  // It has shaken hands again meanwhile, and may seal with these keys from now on.
  LiveSession* const newer = of_key.newest == index ? nullptr : live(of_key.newest);
  if (newer != nullptr && newer->life != there->life) {
    of_key.former = 0;
    return;
  }
  if (newer != nullptr) {
    newer->owner = owner;
    held_[owner]->next = of_key.newest;
    std::erase(unowned_order_, of_key.newest);
  }
  unowned_.erase(there->who);
}

void Sessions::remove(Owner owner) {
  PeerKeys* const gone = held(owner);
  if (gone == nullptr) return;
  for (std::uint32_t* index : {&gone->current, &gone->former, &gone->next, &gone->earlier}) {
    drop(*index);
  }
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
  const PeerKeys* const peer = held(owner);
  const LiveSession* const there = peer == nullptr ? nullptr : live(peer->current);
  return there != nullptr && !there->session.is_over(now);
}

void Sessions::set_out_of_reach(TimePoint now, Owner owner, bool is_out_of_reach) {
  PeerKeys* const peer = held(owner);
  if (peer == nullptr || !peer->initiator) return;
  peer->is_out_of_reach = is_out_of_reach;
  if (!is_out_of_reach && peer->heard_at) peer->patience = PeerKeys::kFirstPatience;
  ask_if_lost(now, *peer);
}

void Sessions::path_added(TimePoint now, Owner owner) {
  PeerKeys* const peer = held(owner);
  if (peer != nullptr && peer->initiator) peer->initiator->hurry(now);
}

// When packets of a peer that we connect to are missed so much that a handshake is due.
std::optional<TimePoint> Sessions::lost_at(const PeerKeys& peer) const {
  if (live(peer.current) == nullptr) return std::nullopt;
  if (!peer.heard_at) return peer.ask_after;
  if (!peer.is_out_of_reach) return std::nullopt;
  return std::max(peer.ask_after, *peer.heard_at + kSilence);
}

void Sessions::ask_if_lost(TimePoint now, PeerKeys& peer) {
  if (live(peer.current) == nullptr || now >= peer.rekey_at) return;
  const auto lost = lost_at(peer);
  if (lost && now >= *lost) {
    peer.initiator->begin(now);
  } else if (peer.initiator->is_trying()) {
    asking_.erase(peer.initiator->index());
    peer.initiator->stop();
  }
}

void Sessions::drop(std::uint32_t& index) {
  live_.erase(index);
  index = 0;
}

void Sessions::promote(PeerKeys& peer, std::uint32_t index) {
  drop(peer.former);
  peer.former = peer.current;
  peer.current = index;
  peer.heard_at.reset();
}

// --- what comes in

Sessions::Opened Sessions::open(TimePoint now, const wire::PacketHeader& header, ByteView packet,
                                std::span<std::byte> out) {
  Opened opened;
  LiveSession* const there = live(header.session.value);
  if (there == nullptr || there->session.is_over(now)) return opened;
  opened.result = there->session.open(header, packet, out);
  if (opened.result != Session::Opened::kOk) return opened;
  // Who is there already was put out when his key was revoked.
  if (!there->owner && trust_.is_revoked(there->who)) {
    forget_unowned(header.session.value);
    return {};
  }
  opened.owner = there->owner;
  opened.who = there->who;
  opened.life = there->life;
  if (!there->owner) {
    Unowned& of_key = unowned_.at(there->who);
    if (of_key.newest == header.session.value) drop_unowned(of_key.former);
    return opened;
  }
  PeerKeys& peer = *held(*there->owner);
  // The other side has the new keys too.
  if (peer.next == header.session.value) {
    drop(peer.earlier);
    peer.next = 0;
    promote(peer, header.session.value);
  } else if (peer.earlier == header.session.value) {
    peer.earlier = 0;
    promote(peer, header.session.value);
  }
  if (peer.current == header.session.value) peer.heard(now, there->session);
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
      out.owner = owner;
      out.may_be_due = true;
      out.is_used = held(owner)->initiator->take_cookie(now, header, datagram.bytes);
      return out;
    }
    take_response(now, owner, datagram.bytes, out);
    return out;
  }
  // An answer to a further copy of what was answered.
  if (header.type != wire::PacketType::kResponse) return out;
  const LiveSession* const there = live(header.session.value);
  if (there == nullptr || !there->owner) return out;
  PeerKeys& peer = *held(*there->owner);
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
  if (verdict == Responder::Verdict::kElsewhere) out.shard = responder_.elsewhere();
  if (verdict != Responder::Verdict::kNew) return;
  const Initiator::Fresh made = fresh(now);
  if (shard_.is_door()) {
    out.shard = responder_.shard_for(now, header, datagram, made);
    return;
  }
  const auto accepted = responder_.accept(now, header, datagram, made);
  if (!accepted) return;
  out.is_used = true;
  const auto owner = owner_of(accepted->who);
  PeerKeys* const peer = owner ? held(*owner) : nullptr;
  const bool is_same_life = peer != nullptr && live(peer->current) != nullptr &&
                            live(peer->current)->life == accepted->theirs.life;
  LiveSession added(
      accepted->who, accepted->theirs,
      Session(now, Session::Role::kResponder, accepted->theirs.index, accepted->keys));
  if (is_same_life) added.owner = owner;
  live_.emplace(made.index, std::move(added));
  if (is_same_life) {
    drop(peer->earlier);
    peer->earlier = peer->next;
    peer->next = made.index;
  } else {
    add_unowned(now, made.index);
  }
}

void Sessions::take_response(TimePoint now, Owner owner, ByteView packet, Shaken& out) {
  PeerKeys& peer = *held(owner);
  const std::uint32_t index = peer.initiator->index();
  const auto answer = peer.initiator->take_response(packet);
  if (!answer) return;
  asking_.erase(index);
  // A host that does not know the time takes that of whom it trusts.
  time_of_day_.raise_unix_ns(now, answer->theirs.unix_ns);
  LiveSession added(peer.who, answer->theirs,
                    Session(now, Session::Role::kInitiator, answer->theirs.index, answer->keys));
  added.owner = owner;
  live_.emplace(index, std::move(added));
  const LiveSession* const before = live(peer.current);
  const bool is_same_life = before != nullptr && before->life == answer->theirs.life;
  promote(peer, index);
  if (!is_same_life) drop(peer.former);
  peer.ask_after = now + peer.patience;
  peer.patience = std::min<Duration>(2 * peer.patience, Initiator::kLastRetry);
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

bool Sessions::seal(TimePoint now, Owner owner, std::span<std::byte> packet, ByteView payload) {
  PeerKeys* const peer = held(owner);
  LiveSession* const there = peer == nullptr ? nullptr : live(peer->current);
  if (there == nullptr || there->session.is_over(now)) return false;
  const bool sealed = there->session.seal(packet, payload);
  peer->renew_if_worn(there->session);
  return sealed;
}

bool Sessions::seal_with(TimePoint now, std::uint32_t index, std::span<std::byte> packet) {
  LiveSession* const there = live(index);
  return there != nullptr && !there->session.is_over(now) && there->session.seal(packet);
}

bool Sessions::initiation_due(TimePoint now, Owner owner) {
  PeerKeys* const peer = held(owner);
  if (peer == nullptr || !peer->initiator || !peer->initiator->is_due(now)) return false;
  if (peer->initiator->needs_message(now)) {
    asking_.erase(peer->initiator->index());
    if (!peer->initiator->make_message(now, fresh(now))) return false;
    asking_[peer->initiator->index()] = owner;
  }
  return true;
}

std::size_t Sessions::write_initiation(Owner owner, LinkId path, std::span<std::byte> out) const {
  return held(owner)->initiator->write(path, out);
}

void Sessions::initiation_sent(TimePoint now, Owner owner) { held(owner)->initiator->tried(now); }

// --- time

std::optional<TimePoint> Sessions::next_timeout(Owner owner) const {
  const PeerKeys* const peer = held(owner);
  if (peer == nullptr || !peer->initiator) return std::nullopt;
  const auto tries = peer->initiator->next_timeout();
  if (tries) return tries;
  const auto rekey =
      peer->rekey_at == TimePoint::max() ? std::nullopt : std::optional(peer->rekey_at);
  return earliest(rekey, lost_at(*peer));
}

void Sessions::expire(TimePoint now, PeerKeys& peer) {
  for (std::uint32_t* index : {&peer.current, &peer.former, &peer.next, &peer.earlier}) {
    const LiveSession* const there = live(*index);
    if (there != nullptr && there->session.is_over(now)) drop(*index);
  }
}

void Sessions::handle_timeout(TimePoint now, Owner owner) {
  PeerKeys* const peer = held(owner);
  if (peer == nullptr) return;
  expire(now, *peer);
  expire_unowned(now);
  if (!peer->initiator) return;
  if (now >= peer->rekey_at) peer->initiator->begin(now);
  ask_if_lost(now, *peer);
}

}  // namespace interneuron::crypto
