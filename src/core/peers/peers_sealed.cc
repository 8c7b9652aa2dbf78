// Where packets are encrypted: what comes in is opened before anything else looks at it, and what
// leaves is sealed after everything else has been done. crypto::Sessions knows whose keys fit.
#include <algorithm>
#include <array>
#include <cassert>

#include "core/peers/peers.h"

namespace interneuron {
namespace {

// A list of revocations is worth its bytes for so long; it may take some of a slow link's time.
constexpr Duration kRevocationsDeadline = std::chrono::seconds(10);

}  // namespace

Peers::Received Peers::receive_sealed(TimePoint now, const Datagram& datagram) {
  LinkCounters& counters = links_[datagram.link].counters;
  Received out;
  const auto header = wire::peek(datagram.bytes);
  if (!header) {
    count_strange(datagram, counters, out);
    return out;
  }
  if (!links_[datagram.link].present) {
    ++counters.refused_packets;
    return out;
  }
  if (header->epoch == wire::kClearEpoch) {
    const bool is_used =
        wire::is_handshake(header->type) && take_handshake(now, *header, datagram, out);
    ++(is_used ? counters.handshake_packets : counters.unauthentic_packets);
    return out;
  }
  std::array<std::byte, kMaxDatagramBytes> opened;
  const auto by = sessions_->open(now, *header, datagram.bytes, opened);
  if (by.result != crypto::Session::Opened::kOk) {
    const bool is_replay = by.result == crypto::Session::Opened::kReplayed;
    ++(is_replay ? counters.duplicate_packets : counters.unauthentic_packets);
    return out;
  }
  const auto packet =
      wire::parse_opened(std::span(opened).first(datagram.bytes.size() - wire::kTagBytes));
  if (!packet) {
    ++counters.malformed_packets;
    return out;
  }
  bool is_served = false;
  if (packet->header.type == wire::PacketType::kEcho) {
    is_served = reflect(now, *packet, datagram);
  } else if (packet->header.type == wire::PacketType::kChallenge) {
    is_served =
        by.owner && entries_[*by.owner]->peer.challenged(packet->header.link, datagram.link,
                                                         datagram.from, packet->challenge.token);
    if (is_served) touch(*entries_[*by.owner]);
  } else {
    const Found found = whose_sealed(now, by, *packet, datagram);
    is_served = found.entry != nullptr;
    if (is_served) hand_over(now, *found.entry, *packet, datagram, out);
  }
  count_received(*packet, datagram, is_served, counters, out);
  return out;
}

// A session without owner becomes a peer with the first packet that shows where it is. One that has
// the key of a peer that is there is that one's next life.
Peers::Found Peers::whose_sealed(TimePoint now, const crypto::Sessions::Opened& by,
                                 const wire::Packet& packet, const Datagram& datagram) {
  if (by.owner) {
    Entry& entry = *entries_[*by.owner];
    return {is_there(now, entry, packet, datagram) ? &entry : nullptr, false};
  }
  if (!wire::is_used(packet.header.type)) return {};
  if (!is_token(now, packet, datagram)) {
    validation_.challenge(now, packet.header, datagram);
    return {};
  }
  if (const auto before = sessions_->owner_of(by.who)) forget(*entries_[*before]);
  wire::PacketHeader header = packet.header;
  header.session = by.life;
  Entry* const entry = accept(now, header, datagram);
  if (entry != nullptr) sessions_->adopt(entry->key, packet.header.session.value);
  return {entry, false};
}

bool Peers::take_handshake(TimePoint now, const wire::PacketHeader& header,
                           const Datagram& datagram, Received& out) {
  const auto shaken = sessions_->take_handshake(now, header, datagram);
  if (shaken.may_be_due) touch(*entries_[shaken.owner]);
  if (!shaken.answered && !shaken.token) return shaken.is_used;
  Entry& entry = *entries_[shaken.owner];
  touch(entry);
  if (shaken.answered) entry.initiations = 0;
  if (shaken.answered && entry.peer.identity().session != shaken.life) {
    out.peer = &entry.peer;
    out.restarted = entry.peer.identity().session.value != 0;
    entry.peer.restart(now, shaken.life);
    account(entry);
  }
  if (shaken.token) {
    entry.peer.challenged(header.link, datagram.link, datagram.from, *shaken.token);
  }
  return true;
}

std::optional<TransmitParts> Peers::leave(TimePoint now, const Entry& entry,
                                          const TransmitParts& parts, std::span<std::byte> buffer) {
  if (!sessions_) return parts;
  // What stands behind the head is room for the tag; the payload moves it back.
  assert(parts.payload.empty() || parts.tail == wire::kTagBytes);
  const std::span<std::byte> packet = buffer.first(parts.size());
  if (!sessions_->seal(now, entry.key, packet, parts.payload)) return std::nullopt;
  return TransmitParts{parts.link, parts.to, packet.size(), {}, 0, parts.ecn, parts.round};
}

bool Peers::seal_answer(TimePoint now, SessionId session, std::span<std::byte> packet) {
  return !sessions_ || sessions_->seal_with(now, session.value, packet);
}

std::optional<TransmitParts> Peers::poll_answers(TimePoint now, std::span<std::byte> buffer) {
  while (const auto echo = reflector_.poll(now, buffer)) {
    if (seal_answer(now, echo->session, buffer.first(echo->size))) {
      return TransmitParts{echo->link, echo->to, echo->size};
    }
  }
  while (const auto challenge = validation_.poll(buffer)) {
    if (seal_answer(now, challenge->session, buffer.first(challenge->size))) {
      return TransmitParts{challenge->link, challenge->to, challenge->size};
    }
  }
  return sessions_ ? poll_handshake(now, buffer) : std::nullopt;
}

std::optional<TransmitParts> Peers::poll_handshake(TimePoint now, std::span<std::byte> buffer) {
  const auto next = sessions_->responder().next();
  if (!next) return std::nullopt;
  // The token is for the packets of the session that is agreed on.
  wire::PacketHeader header;
  header.link = next->path;
  header.session = SessionId{next->index};
  const wire::Token token = validation_.token(now, header, {next->nic, next->to, {}});
  return TransmitParts{next->nic, next->to, sessions_->responder().write(buffer, token)};
}

std::optional<TransmitParts> Peers::poll_initiation(TimePoint now, Entry& entry,
                                                    std::span<std::byte> buffer) {
  if (!sessions_ || !sessions_->initiation_due(now, entry.key)) return std::nullopt;
  const auto paths = entry.peer.paths();
  if (entry.initiations >= paths.size()) {
    entry.initiations = 0;
    sessions_->initiation_sent(now, entry.key);
    mark(entry);
    return std::nullopt;
  }
  const Path& path = paths[entry.initiations++];
  return TransmitParts{path.nic().link, path.address(),
                       sessions_->write_initiation(entry.key, path.id(), buffer)};
}

bool Peers::take_revocations(ByteView bytes) {
  if (!sessions_ || !sessions_->take_revocations(bytes)) return false;
  for (const PeerId id : ids()) {
    Entry& entry = *entries_[by_id_.at(id)];
    if (sessions_->is_revoked(entry.key)) {
      // Who connected has nobody left to talk to: no packet of this peer is opened any more.
      if (entry.peer.identity().connected) {
        sessions_->remove(entry.key);
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
  const Bytes& list = sessions_->trust().revocations();
  if (list.empty()) return;
  Peer& peer = entry.peer;
  std::vector<LinkId> paths;
  for (const Path& path : peer.paths()) {
    if (path.usable()) paths.push_back(path.id());
  }
  if (!peer.ready() || paths.empty() || send_room(peer.identity().id) < list.size() ||
      !sessions_->take_turn_to_tell(now, entry.key)) {
    return;
  }
  flow::Sender::Times times;
  times.deadline = now + kRevocationsDeadline;
  times.lifetime = kRevocationsDeadline;
  times.importance = 0;
  peer.send(now, times, wire::MessageBytes(Bytes(list)), std::span(paths).first(1),
            flow::kEveryPath, wire::MessageKind::kRevocations);
  touch(entry);
}

bool Peers::is_out_of_reach(const Peer& peer) {
  return std::ranges::none_of(
      peer.paths(), [](const Path& path) { return path.estimator.path() == PathState::kOk; });
}

}  // namespace interneuron
