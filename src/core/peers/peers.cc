#include "core/peers/peers.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/base/earliest.h"

namespace interneuron::peers {
namespace {

// A list of revocations is worth its bytes for so long; it may take some of a slow link's time.
constexpr Duration kRevocationsDeadline = std::chrono::seconds(10);
// Links with a smaller MTU than IPv6 allows (1280) are not served better by smaller datagrams:
// eight reports of feedback and the piece count of the largest message fit from here on.
constexpr std::size_t kMinDatagramBytes = 1280 - kIpv6UdpBytes;

// Whether no path to this peer is as it should be.
bool is_out_of_reach(const Peer& peer) {
  return std::ranges::none_of(
      peer.paths(), [](const Path& path) { return path.estimator.path() == PathState::kOk; });
}

}  // namespace

Peers::Peers(const Options& options)
    : options_(options),
      holdings_(options.shard.holdings ? options.shard.holdings
                                       : std::make_shared<SharedHoldings>()),
      table_(options.secret.front(), options.shard),
      gate_({options.self, options.accept, options.started, options.secret, options.security,
             options.shard}),
      reassembly_(options.reassembly_budget_bytes,
                  options.shard.holdings ? &holdings_->reassembly_bytes : nullptr),
      sending_(options.send_budget_bytes,
               options.shard.holdings ? &holdings_->sending_bytes : nullptr) {}

void Peers::add_link(LinkId link, const LinkInfo& info) {
  links_[link].info = info;
  links_[link].present = true;
}

std::vector<PathChanged> Peers::remove_link(TimePoint now, LinkId link) {
  links_[link].present = false;
  gate_.remove_link(link);
  std::vector<PathChanged> changes;
  for (const PeerId id : ids()) {
    Entry& entry = *table_.find(id);
    table_.unlist_addresses(entry);
    entry.peer.remove_nic(now, link);
    table_.list_addresses(entry);
    touch(entry);
    while (auto change = entry.peer.paths().poll_change()) changes.push_back(std::move(*change));
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
  const std::optional<PublicKey> who = gate_.whom(named);
  Entry& entry = add(now, SessionId{}, true);
  gate_.connect(now, entry.slot, who);
  for (const auto& [link, address] : addresses) {
    entry.peer.add_path(now, link, nic(link), address);
  }
  table_.list_addresses(entry);
  touch(entry);
  return entry.peer.identity().id;
}

bool Peers::add_path(TimePoint now, PeerId id, LinkId link, const Address& address) {
  Peer* peer = access(now, id);
  const auto it = links_.find(link);
  if (peer == nullptr || !peer->identity().connected || it == links_.end() || !it->second.present) {
    return false;
  }
  const Entry& entry = *table_.find(id);
  table_.unlist_addresses(entry);
  peer->add_path(now, link, nic(link), address);
  table_.list_addresses(entry);
  gate_.path_added(now, entry.slot);
  return peer->paths().has(link);
}

bool Peers::request_train(TimePoint now, PeerId id, LinkId link) {
  Peer* peer = access(now, id);
  return peer != nullptr && peer->paths().request_train(now, link);
}

Peers::Entry& Peers::add(TimePoint now, SessionId session, bool connected) {
  return table_.add({{},
                     options_.self,
                     session,
                     connected,
                     options_.repair,
                     options_.started,
                     options_.limits,
                     gate_.encrypts()},
                    now);
}

// Only peers that came unannounced are ever forgotten.
void Peers::forget(Entry& entry) {
  lost_.push_back({entry.peer.identity().id, entry.peer.known()});
  gate_.remove(entry.slot);
  alarms_.remove(entry.slot);
  turns_.forget(entry.slot);
  reassembly_.change(entry.reassembly_bytes, 0);
  sending_.change(entry.sending_bytes, 0);
  if (entry.touched) std::erase(touched_, entry.slot);
  table_.remove(entry);
  --holdings_->peers;
}

// Whether there was a place left for an unannounced peer.
bool Peers::take_place() {
  if (holdings_->peers++ < options_.max_unannounced) return true;
  --holdings_->peers;
  return false;
}

Path::Nic Peers::nic(LinkId link) const {
  const LinkInfo& info = links_.at(link).info;
  const std::size_t payload = info.mtu - std::min(info.mtu, kIpv6UdpBytes);
  return {link, std::clamp(payload, kMinDatagramBytes, kMaxDatagramBytes), info.traits};
}

Peer* Peers::access(TimePoint now, std::optional<PeerId> id) {
  Entry* const entry = id ? table_.find(*id) : nullptr;
  if (entry == nullptr) return nullptr;
  touch(*entry);
  entry->peer.look(now);
  return &entry->peer;
}

Peer* Peers::access_only(TimePoint now) {
  Entry* const entry = table_.only();
  return entry == nullptr ? nullptr : access(now, entry->peer.identity().id);
}

// --- revocations

bool Peers::take_revocations(ByteView bytes) {
  if (!gate_.take_revocations(bytes)) return false;
  for (const PeerId id : ids()) {
    Entry& entry = *table_.find(id);
    if (gate_.is_revoked(entry.slot)) {
      // Who connected has nobody left to talk to: no packet of this peer is opened any more.
      if (entry.peer.identity().connected) {
        gate_.remove(entry.slot);
      } else {
        forget(entry);
      }
    } else {
      touch(entry);
    }
  }
  return true;
}

// What is lost of it is told again with the next session.
void Peers::tell_revocations(TimePoint now, Entry& entry) {
  const ByteView list = gate_.revocations();
  if (list.empty()) return;
  Peer& peer = entry.peer;
  const auto over = std::ranges::find_if(peer.paths(), &Path::usable);
  if (!peer.ready() || over == peer.paths().end() || send_room(peer.identity().id) < list.size() ||
      !gate_.take_turn_to_tell(now, entry.slot)) {
    return;
  }
  flow::Sender::Times times;
  times.deadline = now + kRevocationsDeadline;
  times.lifetime = kRevocationsDeadline;
  times.importance = 0;
  peer.send(now, times, wire::MessageBytes(Bytes(list.begin(), list.end())), {over->id()},
            flow::kEveryPath, wire::MessageKind::kRevocations);
  touch(entry);
}

// --- what is due, and whose turn it is

void Peers::touch(Entry& entry) {
  mark(entry);
  turns_.add(entry.slot);
}

void Peers::mark(Entry& entry) {
  if (entry.touched) return;
  entry.touched = true;
  touched_.push_back(entry.slot);
}

void Peers::account(Entry& entry) {
  const auto note = [](SharedMemory& memory, std::size_t& known, std::size_t held) {
    memory.change(known, held);
    known = held;
  };
  note(reassembly_, entry.reassembly_bytes, entry.peer.intake().bytes());
  note(sending_, entry.sending_bytes, entry.peer.sender().bytes());
}

// Whatever changes what a peer sends marks that peer.
std::size_t Peers::sending_bytes() {
  for (const auto slot : touched_) account(table_.at(slot));
  return sending_.used();
}

std::size_t Peers::send_room(PeerId id) {
  sending_bytes();
  return sending_.room(table_.find(id)->sending_bytes);
}

TimePoint Peers::due_at(TimePoint now, const Entry& entry) const {
  TimePoint due = entry.peer.next_timeout(now).value_or(TimePoint::max());
  due = std::min(due, gate_.next_timeout(entry.slot).value_or(due));
  if (entry.peer.identity().connected) return due;
  return entry.peer.paths().empty() ? now : std::min(due, entry.peer.heard_at() + kPeerSilence);
}

void Peers::set_alarms(TimePoint now) {
  for (const auto slot : touched_) {
    Entry& entry = table_.at(slot);
    entry.touched = false;
    account(entry);
    alarms_.set(slot, due_at(now, entry));
  }
  touched_.clear();
}

Peers::Expired Peers::handle_timeout(TimePoint now) {
  Expired expired;
  set_alarms(now);
  due_.clear();
  while (const auto slot = alarms_.pop_due(now)) due_.push_back(*slot);
  for (const auto slot : due_) {
    Entry& entry = table_.at(slot);
    Peer& peer = entry.peer;
    expired.messages += peer.handle_timeout(now);
    gate_.handle_timeout(now, slot, is_out_of_reach(peer));
    tell_revocations(now, entry);
    account(entry);
    while (auto change = peer.paths().poll_change()) expired.changes.push_back(std::move(*change));
    const bool silent = !peer.identity().connected &&
                        (now - peer.heard_at() >= kPeerSilence || peer.paths().empty());
    if (silent) {
      // Not retired: a vehicle that was out of reach for long comes back with the same session.
      forget(entry);
    } else {
      if (peer.sender().has_failed()) expired.failed.push_back(peer.identity().id);
      touch(entry);
    }
  }
  return expired;
}

std::optional<TimePoint> Peers::next_timeout(TimePoint now) const {
  std::optional<TimePoint> next = earliest(gate_.next_answer(), alarms_.earliest());
  for (const auto slot : touched_) next = earliest(next, due_at(now, table_.at(slot)));
  return next;
}

std::optional<TransmitParts> Peers::poll(TimePoint now, std::span<std::byte> buffer) {
  if (const auto answer = gate_.poll_answer(now, buffer)) return count(*answer);
  while (const auto slot = turns_.feedback()) {
    Entry& entry = table_.at(*slot);
    if (const auto initiation = poll_initiation(now, entry, buffer)) {
      mark(entry);
      return count(*initiation);
    }
    if (const auto transmit = entry.peer.poll_feedback(now, buffer)) {
      mark(entry);
      if (const auto out = gate_.seal_for(now, entry.slot, *transmit, buffer)) return count(*out);
      continue;
    }
    turns_.feedback_done();
    for (const Path& path : entry.peer.paths()) turns_.add(*slot, path.nic().link);
  }
  while (const auto turn = turns_.data()) {
    Entry& entry = table_.at(turn->peer);
    if (const auto transmit = entry.peer.poll(now, turn->nic, buffer)) {
      mark(entry);
      turns_.sent(transmit->size() + kIpUdpBytes);
      // What has left may have made symbols for a path that had nothing to send before.
      for (const Path& path : entry.peer.paths()) {
        const auto at = entry.peer.sender().next_send(path.id());
        if (at && *at <= now) turns_.add(turn->peer, path.nic().link);
      }
      if (const auto out = gate_.seal_for(now, entry.slot, *transmit, buffer)) return count(*out);
      continue;
    }
    turns_.done();
  }
  set_alarms(now);
  return std::nullopt;
}

std::optional<TransmitParts> Peers::poll_initiation(TimePoint now, Entry& entry,
                                                    std::span<std::byte> buffer) {
  if (!gate_.initiation_due(now, entry.slot)) return std::nullopt;
  const Paths& paths = entry.peer.paths();
  if (entry.initiations >= paths.size()) {
    entry.initiations = 0;
    gate_.initiation_sent(now, entry.slot);
    mark(entry);
    return std::nullopt;
  }
  const Path& path = paths[entry.initiations++];
  return TransmitParts{path.nic().link, path.address(),
                       gate_.write_initiation(entry.slot, path.id(), buffer)};
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

// --- what is counted and kept, for those who ask

std::vector<LinkState> Peers::links(TimePoint now, PeerId id) const {
  const Entry* const entry = table_.find(id);
  if (entry == nullptr) return {};
  const Links all = entry->peer.links(now);
  return {all.begin(), all.end()};
}

PeerLedger Peers::ledger(PeerId id) const {
  const Entry* const entry = table_.find(id);
  return entry == nullptr ? PeerLedger{} : entry->peer.intake().ledger();
}

LinkCounters Peers::counters(LinkId link) const {
  const auto it = links_.find(link);
  if (it == links_.end()) return {};
  LinkCounters out = it->second.counters;
  table_.for_each([&](const Entry& entry) {
    const Peer::Repairs repairs = entry.peer.repairs(link);
    out.fragments_resent += repairs.resent;
    out.symbols_sent += repairs.symbols;
    out.fragments_lost += repairs.lost;
  });
  return out;
}

std::uint64_t Peers::cancelled() const {
  std::uint64_t sum = 0;
  table_.for_each([&](const Entry& entry) { sum += entry.peer.sender().cancelled(); });
  return sum;
}

}  // namespace interneuron::peers
