// What comes in from anybody: whose a packet is, and what it changes.
//
// In the clear that is told by the session that a packet names and by where it comes from. Whoever
// reads along can say the same, so nobody is believed before a token has shown where he is
// (AddressValidation). A packet that was sealed tells it by its keys.
#include "core/peers/peers.h"

namespace interneuron::peers {
namespace {

void count_strange(const Datagram& datagram, LinkCounters& counters, Peers::Received& out) {
  out.other_version = wire::other_version(datagram.bytes);
  ++(out.other_version ? counters.other_version_packets : counters.malformed_packets);
}

// A datagram that does not go on to the peers.
void count_stopped(Gate::Verdict verdict, const Datagram& datagram, LinkCounters& counters,
                   Peers::Received& out) {
  switch (verdict) {
    case Gate::Verdict::kHandshake:
      ++counters.handshake_packets;
      return;
    case Gate::Verdict::kElsewhere:
      // Counted where it is handed on to.
      return;
    case Gate::Verdict::kRefused:
      ++counters.refused_packets;
      return;
    case Gate::Verdict::kForged:
      ++counters.unauthentic_packets;
      return;
    case Gate::Verdict::kReplayed:
      ++counters.duplicate_packets;
      return;
    case Gate::Verdict::kPacket:
    case Gate::Verdict::kMalformed:
      count_strange(datagram, counters, out);
  }
}

void count_received(const wire::Packet& packet, const Datagram& datagram, bool is_served,
                    LinkCounters& counters, const Peers::Received& out) {
  if (!is_served || out.outcome.limited) {
    ++counters.refused_packets;
  } else if (out.outcome.duplicate) {
    ++counters.duplicate_packets;
  } else {
    ++(wire::is_used(packet.header.type) ? counters.received_packets : counters.other_packets);
    counters.received_bytes += datagram.bytes.size();
  }
}

}  // namespace

Peers::Received Peers::receive(TimePoint now, const Datagram& datagram) {
  Link& link = links_[datagram.link];
  Received out;
  const Gate::Passed passed = gate_.receive(now, datagram, link.present);
  if (passed.shaken) {
    out.shard = passed.shaken->shard;
    take_handshake(now, *passed.shaken, passed.path, datagram, out);
  }
  const auto packet =
      passed.verdict == Gate::Verdict::kPacket ? wire::parse_opened(passed.packet) : std::nullopt;
  if (!packet) {
    count_stopped(passed.verdict, datagram, link.counters, out);
    return out;
  }
  const bool is_served = link.present && serve(now, passed, *packet, datagram, out);
  count_received(*packet, datagram, is_served, link.counters, out);
  return out;
}

bool Peers::serve(TimePoint now, const Gate::Passed& passed, const wire::Packet& packet,
                  const Datagram& datagram, Received& out) {
  if (packet.header.type == wire::PacketType::kEcho) return gate_.reflect(now, packet, datagram);
  if (packet.header.type == wire::PacketType::kChallenge) {
    return take_challenge(passed, packet, datagram);
  }
  const Found found =
      passed.by ? whose(now, *passed.by, packet, datagram) : whose(now, packet, datagram);
  out.restarted = found.restarted;
  if (found.entry == nullptr) return false;
  Peer& peer = found.entry->peer;
  touch(*found.entry);
  out.peer = &peer;
  out.outcome = peer.handle(now, packet, datagram, reassembly_.room(peer.intake().bytes()));
  account(*found.entry);
  return true;
}

std::optional<Peer::Outcome> Peers::receive_computed(TimePoint now, Peer& peer) {
  if (!peer.intake().has_computed()) return std::nullopt;
  Entry& entry = *table_.find(peer.identity().id);
  touch(entry);
  auto outcome = peer.handle_computed(now, reassembly_.room(peer.intake().bytes()));
  account(entry);
  return outcome;
}

void Peers::take_handshake(TimePoint now, const crypto::Sessions::Shaken& shaken, LinkId path,
                           const Datagram& datagram, Received& out) {
  if (shaken.may_be_due) touch(table_.at(shaken.owner));
  if (!shaken.answered && !shaken.token) return;
  Entry& entry = table_.at(shaken.owner);
  touch(entry);
  if (shaken.answered) entry.initiations = 0;
  if (shaken.answered && entry.peer.identity().session != shaken.life) {
    out.peer = &entry.peer;
    out.restarted = entry.peer.identity().session.value != 0;
    entry.peer.restart(now, shaken.life);
    account(entry);
  }
  if (shaken.token)
    entry.peer.paths().challenged(path, datagram.link, datagram.from, *shaken.token);
}

// A session without owner becomes a peer with the first packet that shows where it is. One that has
// the key of a peer that is there is that one's next life.
Peers::Found Peers::whose(TimePoint now, const crypto::Sessions::Opened& by,
                          const wire::Packet& packet, const Datagram& datagram) {
  if (by.owner) {
    Entry& entry = table_.at(*by.owner);
    return {is_there(now, entry, packet, datagram) ? &entry : nullptr, false};
  }
  if (!wire::is_used(packet.header.type)) return {};
  if (!gate_.is_token(now, packet, datagram)) {
    gate_.challenge(now, packet.header, datagram);
    return {};
  }
  if (const auto before = gate_.owner_of(by.who)) forget(table_.at(*before));
  wire::PacketHeader header = packet.header;
  header.session = by.life;
  Entry* const entry = accept(now, header, datagram);
  if (entry != nullptr) gate_.adopt(entry->slot, packet.header.session);
  return {entry, false};
}

Peers::Found Peers::whose(TimePoint now, const wire::Packet& packet, const Datagram& datagram) {
  const wire::PacketHeader& header = packet.header;
  if (header.session == options_.self || table_.is_retired(header.session)) return {};
  if (Entry* entry = table_.of_session(header)) {
    return {is_there(now, *entry, packet, datagram) ? entry : nullptr, false};
  }
  // A new session begins with a packet that means something.
  if (!wire::is_used(header.type)) return {};
  Entry* entry = table_.of_address(header, datagram);
  if (entry == nullptr && !options_.accept) return {};
  // A peer that we connected to shows by repeating our session that it has heard us; anybody else
  // could have asked for that from elsewhere.
  const bool repeats_us = entry != nullptr && header.type == wire::PacketType::kFeedback &&
                          packet.feedback.echo == options_.self;
  if (!repeats_us && !gate_.is_token(now, packet, datagram)) {
    gate_.challenge(now, header, datagram);
    return {};
  }
  if (entry == nullptr) return {accept(now, header, datagram), false};
  const bool was_heard = entry->peer.identity().session.value != 0;
  table_.change_session(*entry, header.session);
  entry->peer.restart(now, header.session);
  account(*entry);
  return {entry, was_heard};
}

// Packets of a known path of a peer that came unannounced are taken wherever they come from; only
// the path stays where it was. So nothing is lost while a peer proves its new address. The session
// of a peer that we connected to is no secret, since it tells it to all who ask: its packets come
// from where we have connected to, as its first one did.
bool Peers::is_there(TimePoint now, Entry& entry, const wire::Packet& packet,
                     const Datagram& datagram) {
  Peer& peer = entry.peer;
  const LinkId path = packet.header.link;
  const bool moved = !peer.paths().is_at(path, datagram.link, datagram.from);
  if (peer.identity().connected) return !moved;
  if (moved && gate_.is_token(now, packet, datagram)) {
    peer.follow(now, packet.header, nic(datagram.link), datagram.from);
  } else if (moved && peer.paths().may_challenge(now, packet.header)) {
    gate_.challenge(now, packet.header, datagram);
  }
  return peer.paths().has(path);
}

// In the clear whoever asks has to repeat our session, so that only those who receive what we send
// can make us answer.
bool Peers::take_challenge(const Gate::Passed& passed, const wire::Packet& packet,
                           const Datagram& datagram) {
  bool is_ours = false;
  const auto ask = [&](Entry& entry) {
    if (!entry.peer.paths().challenged(packet.header.link, datagram.link, datagram.from,
                                       packet.challenge.token)) {
      return;
    }
    touch(entry);
    is_ours = true;
  };
  if (!passed.by) {
    if (packet.challenge.echo != options_.self) return false;
    table_.for_each_at(datagram.link, datagram.from, ask);
  } else if (passed.by->owner) {
    ask(table_.at(*passed.by->owner));
  }
  return is_ours;
}

Peers::Entry* Peers::accept(TimePoint now, const wire::PacketHeader& header,
                            const Datagram& datagram) {
  if (!options_.accept) return nullptr;
  if (!take_place()) {
    Entry* const leaves = table_.makes_room(now, datagram.from);
    if (leaves == nullptr) return nullptr;
    forget(*leaves);
    if (!take_place()) return nullptr;
  }
  Entry& entry = add(now, header.session, false);
  entry.first_seen_at = datagram.from;
  entry.peer.add_path(now, header.link, nic(datagram.link), datagram.from);
  return &entry;
}

}  // namespace interneuron::peers
