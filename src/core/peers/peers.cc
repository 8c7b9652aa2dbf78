#include "core/peers/peers.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/base/earliest.h"

namespace interneuron {
namespace {

// How many sessions that restarted peers had before are remembered: packets of theirs that come
// late must not bring them back.
constexpr std::size_t kRetired = 64;
// Links with a smaller MTU than IPv6 allows (1280) are not served better by smaller datagrams:
// eight reports of feedback and the piece count of the largest message fit from here on.
constexpr std::size_t kMinDatagramBytes = 1280 - kIpv6UdpBytes;

}  // namespace

void Peers::add_link(LinkId link, const LinkInfo& info) {
  links_[link].info = info;
  links_[link].present = true;
}

std::vector<PathChanged> Peers::remove_link(TimePoint now, LinkId link) {
  links_[link].present = false;
  reflector_.remove_link(link);
  std::vector<PathChanged> changes;
  for (auto& [id, peer] : peers_) {
    peer.remove_nic(now, link);
    while (auto change = peer.poll_change()) changes.push_back(std::move(*change));
  }
  return changes;
}

PeerId Peers::connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses) {
  for (const auto& [link, address] : addresses) {
    const auto it = links_.find(link);
    if (it == links_.end() || !it->second.present) {
      throw std::invalid_argument("connect: link " + std::to_string(link.value) + " was not added");
    }
  }
  const PeerId id = add(now, SessionId{}, true);
  for (const auto& [link, address] : addresses) {
    peers_.at(id).add_path(now, link, nic(link), address);
  }
  return id;
}

bool Peers::add_path(TimePoint now, PeerId id, LinkId link, const Address& address) {
  Peer* peer = find(id);
  const auto it = links_.find(link);
  if (peer == nullptr || !peer->identity().connected || it == links_.end() || !it->second.present) {
    return false;
  }
  peer->add_path(now, link, nic(link), address);
  return peer->has_path(link);
}

bool Peers::request_train(TimePoint now, PeerId id, LinkId link) {
  Peer* peer = find(id);
  return peer != nullptr && peer->request_train(now, link);
}

PeerId Peers::add(TimePoint now, SessionId session, bool connected) {
  const PeerId id{next_++};
  peers_.try_emplace(
      id, Peer::Identity{id, options_.self, session, connected, options_.repair, options_.started},
      now);
  return id;
}

Path::Nic Peers::nic(LinkId link) const {
  const LinkInfo& info = links_.at(link).info;
  const std::size_t payload = info.mtu - std::min(info.mtu, kIpv6UdpBytes);
  return {link, std::clamp(payload, kMinDatagramBytes, kMaxDatagramBytes), info.traits};
}

void Peers::retire(SessionId session) {
  if (session.value == 0) return;
  retired_.push_back(session);
  if (retired_.size() > kRetired) retired_.pop_front();
}

Peers::Received Peers::receive(TimePoint now, const Datagram& datagram) {
  LinkCounters& counters = links_[datagram.link].counters;
  const auto packet = wire::parse(datagram.bytes);
  if (!packet) {
    ++counters.malformed_packets;
    return {};
  }
  Received out;
  bool is_served = false;
  if (packet->header.type == wire::PacketType::kEcho) {
    is_served = reflect(now, *packet, datagram);
  } else {
    const Found found = whose(now, packet->header, datagram);
    out.peer = found.peer;
    out.restarted = found.restarted;
    is_served = found.peer != nullptr;
  }
  if (!is_served) {
    ++counters.refused_packets;
    return out;
  }
  if (out.peer != nullptr) out.input = out.peer->handle(now, *packet, datagram.bytes.size());
  if (out.input.duplicate) {
    ++counters.duplicate_packets;
    return out;
  }
  ++counters.received_packets;
  counters.received_bytes += datagram.bytes.size();
  return out;
}

Peers::Found Peers::whose(TimePoint now, const wire::PacketHeader& header,
                          const Datagram& datagram) {
  const auto link = links_.find(datagram.link);
  if (link == links_.end() || !link->second.present || header.session == options_.self ||
      std::ranges::find(retired_, header.session) != retired_.end()) {
    return {};
  }
  for (auto& [id, peer] : peers_) {
    if (peer.identity().session != header.session) continue;
    if (!peer.identity().connected) {
      peer.add_path(now, header.link, nic(datagram.link), datagram.from);
    }
    if (peer.has_path(header.link)) return {&peer, false};
    // We may have connected again to a peer whose links we had lost.
    if (!peer.identity().connected) return {};
  }
  for (auto& [id, peer] : peers_) {
    const SessionId before = peer.identity().session;
    if (!peer.identity().connected || before == header.session ||
        !peer.reached_at(datagram.link, datagram.from) || !peer.has_path(header.link)) {
      continue;
    }
    retire(before);
    peer.restart(now, header.session);
    return {&peer, before.value != 0};
  }
  return {accept(now, header, datagram), false};
}

Peer* Peers::accept(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram) {
  const auto unannounced = std::ranges::count_if(
      peers_, [](const auto& entry) { return !entry.second.identity().connected; });
  if (!options_.accept || std::cmp_greater_equal(unannounced, options_.max_unannounced)) {
    return nullptr;
  }
  Peer& peer = peers_.at(add(now, header.session, false));
  peer.add_path(now, header.link, nic(datagram.link), datagram.from);
  return &peer;
}

bool Peers::reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram) {
  const auto link = links_.find(datagram.link);
  return options_.accept && link != links_.end() && link->second.present &&
         reflector_.take(now, packet, datagram);
}

Peer* Peers::find(std::optional<PeerId> id) {
  if (!id) return nullptr;
  const auto it = peers_.find(*id);
  return it == peers_.end() ? nullptr : &it->second;
}

Peers::Expired Peers::handle_timeout(TimePoint now) {
  Expired expired;
  for (auto it = peers_.begin(); it != peers_.end();) {
    expired.messages += it->second.handle_timeout(now);
    while (auto change = it->second.poll_change()) expired.changes.push_back(std::move(*change));
    const bool silent = !it->second.identity().connected &&
                        (now - it->second.heard_at() >= kPeerSilence || it->second.gone());
    if (silent) {
      // Not retired: a vehicle that was out of reach for long comes back with the same session.
      expired.lost.push_back(it->first);
      it = peers_.erase(it);
    } else {
      ++it;
    }
  }
  return expired;
}

std::optional<TimePoint> Peers::next_timeout(TimePoint now) const {
  std::optional<TimePoint> next = reflector_.next_timeout();
  for (const auto& [id, peer] : peers_) {
    next = earliest(next, peer.next_timeout(now));
    if (!peer.identity().connected) next = earliest(next, peer.heard_at() + kPeerSilence);
  }
  return next;
}

std::optional<Transmit> Peers::poll(TimePoint now, std::span<std::byte> buffer) {
  if (const auto echo = reflector_.poll(now, buffer)) return count(*echo);
  for (auto& [id, peer] : peers_) {
    if (const auto transmit = peer.poll(now, buffer)) return count(*transmit);
  }
  return std::nullopt;
}

Transmit Peers::count(const Transmit& transmit) {
  LinkCounters& sent = links_[transmit.link].counters;
  ++sent.sent_packets;
  sent.sent_bytes += transmit.size;
  return transmit;
}

std::vector<PeerId> Peers::ids() const {
  std::vector<PeerId> out;
  for (const auto& [id, peer] : peers_) out.push_back(id);
  return out;
}

std::vector<LinkState> Peers::links(TimePoint now, PeerId id) const {
  const auto it = peers_.find(id);
  if (it == peers_.end()) return {};
  const Links all = it->second.links(now);
  return {all.begin(), all.end()};
}

LinkCounters Peers::counters(LinkId link) const {
  const auto it = links_.find(link);
  if (it == links_.end()) return {};
  LinkCounters out = it->second.counters;
  for (const auto& [id, peer] : peers_) {
    const auto [resent, lost] = peer.repairs(link);
    out.fragments_resent += resent;
    out.fragments_lost += lost;
  }
  return out;
}

std::uint64_t Peers::cancelled() const {
  std::uint64_t sum = 0;
  for (const auto& [id, peer] : peers_) sum += peer.cancelled();
  return sum;
}

std::size_t Peers::reassembly_bytes() const {
  std::size_t sum = 0;
  for (const auto& [id, peer] : peers_) sum += peer.reassembly_bytes();
  return sum;
}

}  // namespace interneuron
