// Where packets come in the clear: whose one is that says which session it is of, and where it
// comes from. Whoever reads along can say the same, so nobody is believed before a token has shown
// where he is (AddressValidation).
#include "core/peers/peers.h"

namespace interneuron {

Peers::Received Peers::receive_clear(TimePoint now, const Datagram& datagram) {
  LinkCounters& counters = links_[datagram.link].counters;
  const auto packet = wire::parse(datagram.bytes);
  Received out;
  if (!packet) {
    count_strange(datagram, counters, out);
    return out;
  }
  bool is_served = false;
  if (packet->header.type == wire::PacketType::kEcho) {
    is_served = reflect(now, *packet, datagram);
  } else if (packet->header.type == wire::PacketType::kChallenge) {
    is_served = take_challenge(*packet, datagram);
  } else {
    const Found found = whose(now, *packet, datagram);
    out.restarted = found.restarted;
    is_served = found.entry != nullptr;
    if (is_served) hand_over(now, *found.entry, *packet, datagram, out);
  }
  count_received(*packet, datagram, is_served, counters, out);
  return out;
}

Peers::Found Peers::whose(TimePoint now, const wire::Packet& packet, const Datagram& datagram) {
  const wire::PacketHeader& header = packet.header;
  const auto link = links_.find(datagram.link);
  if (link == links_.end() || !link->second.present || header.session == options_.self ||
      directory_.is_retired(header.session)) {
    return {};
  }
  if (Entry* entry = by_session(header)) {
    return {is_there(now, *entry, packet, datagram) ? entry : nullptr, false};
  }
  // A new session begins with a packet that means something.
  if (!wire::is_used(header.type)) return {};
  Entry* entry = by_address(header, datagram);
  if (entry == nullptr && !options_.accept) return {};
  // A peer that we connected to shows by repeating our session that it has heard us; anybody else
  // could have asked for that from elsewhere.
  const bool repeats_us = entry != nullptr && header.type == wire::PacketType::kFeedback &&
                          packet.feedback.echo == options_.self;
  if (!repeats_us && !is_token(now, packet, datagram)) {
    validation_.challenge(now, header, datagram);
    return {};
  }
  if (entry != nullptr) {
    const SessionId before = entry->peer.identity().session;
    directory_.retire(before);
    directory_.remove_session(before, entry->key);
    directory_.add_session(header.session, entry->key);
    entry->peer.restart(now, header.session);
    account(*entry);
    return {entry, before.value != 0};
  }
  return {accept(now, header, datagram), false};
}

// Whoever asks has to repeat our session, so that only those who receive what we send can make us
// answer.
bool Peers::take_challenge(const wire::Packet& packet, const Datagram& datagram) {
  if (packet.challenge.echo != options_.self) return false;
  bool is_ours = false;
  directory_.for_each(datagram.link, datagram.from, [&](Key key) {
    Entry& entry = *entries_[key];
    if (!entry.peer.challenged(packet.header.link, datagram.link, datagram.from,
                               packet.challenge.token)) {
      return;
    }
    touch(entry);
    is_ours = true;
  });
  return is_ours;
}

// The peer of this session. Of several it is the first that came unannounced or has the path: we
// may have connected again to a peer whose links we had lost.
Peers::Entry* Peers::by_session(const wire::PacketHeader& header) {
  Entry* found = nullptr;
  directory_.for_each(header.session, [&](Key key) {
    Entry& entry = *entries_[key];
    const Peer::Identity& identity = entry.peer.identity();
    if (identity.connected && !entry.peer.has_path(header.link)) return;
    if (found == nullptr || identity.id < found->peer.identity().id) found = &entry;
  });
  return found;
}

// The first peer that we connected to at the address that this packet came from.
Peers::Entry* Peers::by_address(const wire::PacketHeader& header, const Datagram& datagram) {
  Entry* found = nullptr;
  directory_.for_each(datagram.link, datagram.from, [&](Key key) {
    Entry& entry = *entries_[key];
    const Peer::Identity& identity = entry.peer.identity();
    if (identity.session == header.session || !entry.peer.has_path(header.link)) return;
    if (found == nullptr || identity.id < found->peer.identity().id) found = &entry;
  });
  return found;
}

}  // namespace interneuron
