#include "core/peers/peers.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/base/earliest.h"

namespace interneuron {
namespace {

// Links with a smaller MTU than IPv6 allows (1280) are not served better by smaller datagrams:
// eight reports of feedback and the piece count of the largest message fit from here on.
constexpr std::size_t kMinDatagramBytes = 1280 - kIpv6UdpBytes;

}  // namespace

Peers::Peers(const Options& options)
    : options_(options),
      directory_(options.secret.front()),
      reassembly_(options.reassembly_budget_bytes),
      sending_(options.send_budget_bytes),
      reflector_(options.self),
      validation_(options.self, options.secret) {
  if (options.security) {
    sessions_.emplace(*options.security, options.self, options.accept, options.started);
  }
}

void Peers::add_link(LinkId link, const LinkInfo& info) {
  links_[link].info = info;
  links_[link].present = true;
}

std::vector<PathChanged> Peers::remove_link(TimePoint now, LinkId link) {
  links_[link].present = false;
  reflector_.remove_link(link);
  validation_.remove_link(link);
  if (sessions_) sessions_->responder().remove_link(link);
  std::vector<PathChanged> changes;
  for (const PeerId id : ids()) {
    Entry& entry = *entries_[by_id_.at(id)];
    unlist_addresses(entry);
    entry.peer.remove_nic(now, link);
    list_addresses(entry);
    touch(entry);
    while (auto change = entry.peer.poll_change()) changes.push_back(std::move(*change));
  }
  return changes;
}

PeerId Peers::connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses,
                      const std::optional<PublicKey>& named) {
  for (const auto& [link, address] : addresses) {
    const auto it = links_.find(link);
    if (it == links_.end() || !it->second.present) {
      throw std::invalid_argument("connect: link " + std::to_string(link.value) + " was not added");
    }
  }
  const std::optional<PublicKey> who = named || !sessions_ ? named : sessions_->trust().only_peer();
  if (sessions_ && (!who || !sessions_->trust().may_connect(*who))) {
    throw std::invalid_argument(who ? "connect: the key " + to_base64(*who) + " is not trusted"
                                    : "connect: say which of the trusted peers this is");
  }
  if (sessions_ && sessions_->is_connected(*who)) {
    throw std::invalid_argument("connect: " + to_base64(*who) + " is connected to already");
  }
  Entry& entry = add(now, SessionId{}, true);
  if (sessions_) sessions_->connect(now, entry.key, *who);
  for (const auto& [link, address] : addresses) {
    entry.peer.add_path(now, link, nic(link), address);
  }
  list_addresses(entry);
  touch(entry);
  return entry.peer.identity().id;
}

bool Peers::add_path(TimePoint now, PeerId id, LinkId link, const Address& address) {
  Peer* peer = find(now, id);
  const auto it = links_.find(link);
  if (peer == nullptr || !peer->identity().connected || it == links_.end() || !it->second.present) {
    return false;
  }
  const Entry& entry = *entries_[by_id_.at(id)];
  unlist_addresses(entry);
  peer->add_path(now, link, nic(link), address);
  list_addresses(entry);
  if (sessions_) sessions_->path_added(now, entry.key);
  return peer->has_path(link);
}

bool Peers::request_train(TimePoint now, PeerId id, LinkId link) {
  Peer* peer = find(now, id);
  return peer != nullptr && peer->request_train(now, link);
}

Peers::Entry& Peers::add(TimePoint now, SessionId session, bool connected) {
  if (free_.empty()) {
    free_.push_back(static_cast<Key>(entries_.size()));
    entries_.emplace_back();
  }
  const Key key = free_.back();
  free_.pop_back();
  const PeerId id{next_++};
  entries_[key] = std::make_unique<Entry>(
      key,
      Peer::Identity{id, options_.self, session, connected, options_.repair, options_.started,
                     options_.limits, sessions_.has_value()},
      now);
  by_id_.emplace(id, key);
  directory_.add_session(session, key);
  if (!connected) ++unannounced_;
  return *entries_[key];
}

// Only unannounced peers are ever forgotten, and their addresses are not listed.
void Peers::forget(Entry& entry) {
  const Key key = entry.key;
  --unannounced_;
  lost_.push_back({entry.peer.identity().id, entry.peer.known()});
  directory_.remove_session(entry.peer.identity().session, key);
  by_id_.erase(entry.peer.identity().id);
  if (sessions_) sessions_->remove(key);
  alarms_.remove(key);
  turns_.forget(key);
  reassembly_.change(entry.reassembly_bytes, 0);
  sending_.change(entry.sending_bytes, 0);
  if (entry.touched) std::erase(touched_, key);
  entries_[key].reset();
  free_.push_back(key);
}

void Peers::list_addresses(const Entry& entry) {
  if (!entry.peer.identity().connected) return;
  for (const Path& path : entry.peer.paths()) {
    directory_.add_address(path.nic().link, path.address(), entry.key);
  }
}

void Peers::unlist_addresses(const Entry& entry) {
  if (!entry.peer.identity().connected) return;
  for (const Path& path : entry.peer.paths()) {
    directory_.remove_address(path.nic().link, path.address(), entry.key);
  }
}

Path::Nic Peers::nic(LinkId link) const {
  const LinkInfo& info = links_.at(link).info;
  const std::size_t payload = info.mtu - std::min(info.mtu, kIpv6UdpBytes);
  return {link, std::clamp(payload, kMinDatagramBytes, kMaxDatagramBytes), info.traits};
}

Peers::Received Peers::receive(TimePoint now, const Datagram& datagram) {
  return sessions_ ? receive_sealed(now, datagram) : receive_clear(now, datagram);
}

void Peers::count_strange(const Datagram& datagram, LinkCounters& counters, Received& out) {
  out.other_version = wire::other_version(datagram.bytes);
  ++(out.other_version ? counters.other_version_packets : counters.malformed_packets);
}

void Peers::count_received(const wire::Packet& packet, const Datagram& datagram, bool is_served,
                           LinkCounters& counters, const Received& out) {
  if (!is_served || out.input.limited) {
    ++counters.refused_packets;
  } else if (out.input.duplicate) {
    ++counters.duplicate_packets;
  } else {
    ++(wire::is_used(packet.header.type) ? counters.received_packets : counters.other_packets);
    counters.received_bytes += datagram.bytes.size();
  }
}

void Peers::hand_over(TimePoint now, Entry& entry, const wire::Packet& packet,
                      const Datagram& datagram, Received& out) {
  touch(entry);
  out.peer = &entry.peer;
  out.input =
      entry.peer.handle(now, packet, datagram, reassembly_.room(entry.peer.reassembly_bytes()));
  account(entry);
}

bool Peers::is_token(TimePoint now, const wire::Packet& packet, const Datagram& datagram) const {
  return packet.header.type == wire::PacketType::kToken &&
         validation_.proves(now, packet.header, datagram, packet.token);
}

// Packets of a known path of a peer that came unannounced are taken wherever they come from; only
// the path stays where it was. So nothing is lost while a peer proves its new address. The session
// of a peer that we connected to is no secret, since it tells it to all who ask: its packets come
// from where we have connected to, as its first one did.
bool Peers::is_there(TimePoint now, Entry& entry, const wire::Packet& packet,
                     const Datagram& datagram) {
  Peer& peer = entry.peer;
  const LinkId path = packet.header.link;
  const bool moved = !peer.is_at(path, datagram.link, datagram.from);
  if (peer.identity().connected) return !moved;
  if (moved && is_token(now, packet, datagram)) {
    peer.follow(now, packet.header, nic(datagram.link), datagram.from);
  } else if (moved && peer.may_challenge(now, packet.header)) {
    validation_.challenge(now, packet.header, datagram);
  }
  return peer.has_path(path);
}

bool Peers::reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram) {
  const auto link = links_.find(datagram.link);
  if (!options_.accept || link == links_.end() || !link->second.present) return false;
  const EchoReflector::Asker asker{
      validation_.proves(now, packet.header, datagram, packet.echo.token),
      validation_.token(now, packet.header, datagram)};
  return reflector_.take(now, packet, datagram, asker);
}

Peer* Peers::find(TimePoint now, std::optional<PeerId> id) {
  if (!id) return nullptr;
  const auto it = by_id_.find(*id);
  if (it == by_id_.end()) return nullptr;
  Entry& entry = *entries_[it->second];
  touch(entry);
  entry.peer.look(now);
  return &entry.peer;
}

Peer* Peers::only(TimePoint now) {
  return by_id_.size() == 1 ? find(now, by_id_.begin()->first) : nullptr;
}

// --- what is due, and whose turn it is

void Peers::touch(Entry& entry) {
  mark(entry);
  turns_.add(entry.key);
}

void Peers::mark(Entry& entry) {
  if (entry.touched) return;
  entry.touched = true;
  touched_.push_back(entry.key);
}

void Peers::account(Entry& entry) {
  const auto note = [](SharedMemory& memory, std::size_t& known, std::size_t held) {
    memory.change(known, held);
    known = held;
  };
  note(reassembly_, entry.reassembly_bytes, entry.peer.reassembly_bytes());
  note(sending_, entry.sending_bytes, entry.peer.sending_bytes());
}

// Whatever changes what a peer sends marks that peer.
std::size_t Peers::sending_bytes() {
  for (const Key key : touched_) account(*entries_[key]);
  return sending_.used();
}

std::size_t Peers::send_room(PeerId id) {
  sending_bytes();
  return sending_.room(entries_[by_id_.at(id)]->sending_bytes);
}

TimePoint Peers::due_at(TimePoint now, const Entry& entry) const {
  TimePoint due = entry.peer.next_timeout(now).value_or(TimePoint::max());
  if (sessions_) due = std::min(due, sessions_->next_timeout(entry.key).value_or(due));
  if (entry.peer.identity().connected) return due;
  return entry.peer.gone() ? now : std::min(due, entry.peer.heard_at() + kPeerSilence);
}

void Peers::set_alarms(TimePoint now) {
  for (const Key key : touched_) {
    Entry& entry = *entries_[key];
    entry.touched = false;
    account(entry);
    alarms_.set(key, due_at(now, entry));
  }
  touched_.clear();
}

Peers::Expired Peers::handle_timeout(TimePoint now) {
  Expired expired;
  set_alarms(now);
  due_.clear();
  while (const auto key = alarms_.pop_due(now)) due_.push_back(*key);
  for (const Key key : due_) {
    Entry& entry = *entries_[key];
    Peer& peer = entry.peer;
    expired.messages += peer.handle_timeout(now);
    if (sessions_) {
      sessions_->set_out_of_reach(now, key, is_out_of_reach(peer));
      sessions_->handle_timeout(now, key);
      tell_revocations(now, entry);
    }
    account(entry);
    while (auto change = peer.poll_change()) expired.changes.push_back(std::move(*change));
    const bool silent =
        !peer.identity().connected && (now - peer.heard_at() >= kPeerSilence || peer.gone());
    if (silent) {
      // Not retired: a vehicle that was out of reach for long comes back with the same session.
      forget(entry);
    } else {
      touch(entry);
    }
  }
  return expired;
}

std::optional<TimePoint> Peers::next_timeout(TimePoint now) const {
  std::optional<TimePoint> next = earliest(reflector_.next_timeout(), alarms_.earliest());
  for (const Key key : touched_) next = earliest(next, due_at(now, *entries_[key]));
  return next;
}

std::optional<TransmitParts> Peers::poll(TimePoint now, std::span<std::byte> buffer) {
  if (const auto answer = poll_answers(now, buffer)) return count(*answer);
  while (const auto key = turns_.feedback()) {
    Entry& entry = *entries_[*key];
    if (const auto initiation = poll_initiation(now, entry, buffer)) {
      mark(entry);
      return count(*initiation);
    }
    if (const auto transmit = entry.peer.poll_feedback(now, buffer)) {
      mark(entry);
      if (const auto out = leave(now, entry, *transmit, buffer)) return count(*out);
      continue;
    }
    turns_.feedback_done();
    for (const Path& path : entry.peer.paths()) turns_.add(*key, path.nic().link);
  }
  while (const auto turn = turns_.data()) {
    Entry& entry = *entries_[turn->peer];
    if (const auto transmit = entry.peer.poll(now, turn->nic, buffer)) {
      mark(entry);
      turns_.sent(transmit->size() + kIpUdpBytes);
      if (const auto out = leave(now, entry, *transmit, buffer)) return count(*out);
      continue;
    }
    turns_.done();
  }
  set_alarms(now);
  return std::nullopt;
}

TransmitParts Peers::count(const TransmitParts& transmit) {
  LinkCounters& sent = links_[transmit.link].counters;
  ++sent.sent_packets;
  sent.sent_bytes += transmit.size();
  return transmit;
}

std::optional<Peers::Lost> Peers::poll_lost() {
  if (lost_.empty()) return std::nullopt;
  const Lost lost = lost_.front();
  lost_.pop_front();
  return lost;
}

std::vector<PeerId> Peers::ids() const {
  std::vector<PeerId> out;
  for (const auto& [id, key] : by_id_) out.push_back(id);
  std::ranges::sort(out);
  return out;
}

std::vector<LinkState> Peers::links(TimePoint now, PeerId id) const {
  const auto it = by_id_.find(id);
  if (it == by_id_.end()) return {};
  const Links all = entries_[it->second]->peer.links(now);
  return {all.begin(), all.end()};
}

}  // namespace interneuron
