#include "core/peers/gate.h"

#include <cassert>
#include <stdexcept>

namespace interneuron::peers {

Gate::Gate(const Options& options)
    : accept_(options.accept), reflector_(options.self), validation_(options.self, options.secret) {
  if (options.security) {
    sessions_.emplace(*options.security, options.self, options.accept, options.started,
                      crypto::ciphers_here(), options.shard);
  }
}

void Gate::remove_link(LinkId link) {
  reflector_.remove_link(link);
  validation_.remove_link(link);
  if (sessions_) sessions_->responder().remove_link(link);
}

// --- what comes in

Gate::Passed Gate::receive(TimePoint now, const Datagram& datagram, bool is_there) {
  if (sessions_) return open(now, datagram, is_there);
  const auto packet = wire::without_tag(datagram.bytes);
  if (!packet) return {};
  return {.verdict = Verdict::kPacket, .packet = *packet};
}

Gate::Passed Gate::open(TimePoint now, const Datagram& datagram, bool is_there) {
  const auto header = wire::peek(datagram.bytes);
  if (!header) return {};
  if (!is_there) return {.verdict = Verdict::kRefused};
  if (header->epoch == wire::kClearEpoch) {
    if (!wire::is_handshake(header->type)) return {.verdict = Verdict::kForged};
    const auto shaken = sessions_->take_handshake(now, *header, datagram);
    Passed passed{.verdict = shaken.is_used ? Verdict::kHandshake : Verdict::kForged,
                  .shaken = shaken,
                  .path = header->link};
    if (shaken.shard != 0) passed.verdict = Verdict::kElsewhere;
    return passed;
  }
  const auto by = sessions_->open(now, *header, datagram.bytes, opened_);
  if (by.result == crypto::Session::Opened::kReplayed) return {.verdict = Verdict::kReplayed};
  if (by.result != crypto::Session::Opened::kOk) return {.verdict = Verdict::kForged};
  const std::size_t size = datagram.bytes.size() - wire::kTagBytes;
  return {.verdict = Verdict::kPacket, .packet = ByteView(opened_).first(size), .by = by};
}

// --- strangers

bool Gate::is_token(TimePoint now, const wire::Packet& packet, const Datagram& datagram) const {
  return packet.header.type == wire::PacketType::kToken &&
         validation_.proves(now, packet.header, datagram, packet.token);
}

bool Gate::reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram) {
  if (!accept_) return false;
  const probe::EchoReflector::Asker asker{
      validation_.proves(now, packet.header, datagram, packet.echo.token),
      validation_.token(now, packet.header, datagram)};
  return reflector_.take(now, packet, datagram, asker);
}

// Seals what answers a packet of this session and has no number of its own. False: it must not
// leave.
bool Gate::seal_answer(TimePoint now, SessionId session, std::span<std::byte> packet) {
  return !sessions_ || sessions_->seal_with(now, session.value, packet);
}

std::optional<TransmitParts> Gate::poll_answer(TimePoint now, std::span<std::byte> buffer) {
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

std::optional<TransmitParts> Gate::poll_handshake(TimePoint now, std::span<std::byte> buffer) {
  const auto next = sessions_->responder().next();
  if (!next) return std::nullopt;
  // The token is for the packets of the session that is agreed on.
  wire::PacketHeader header;
  header.link = next->path;
  header.session = SessionId{next->index};
  const wire::Token token = validation_.token(now, header, {next->nic, next->to, {}});
  return TransmitParts{next->nic, next->to, sessions_->responder().write(buffer, token)};
}

// --- peers

std::optional<TransmitParts> Gate::seal_for(TimePoint now, Slot slot, const TransmitParts& parts,
                                            std::span<std::byte> buffer) {
  if (!sessions_) return parts;
  // What stands behind the head is room for the tag; the payload moves it back.
  assert(parts.payload.empty() || parts.tail == wire::kTagBytes);
  const std::span<std::byte> packet = buffer.first(parts.size());
  if (!sessions_->seal(now, slot, packet, parts.payload)) return std::nullopt;
  return TransmitParts{parts.link, parts.to, packet.size(), {}, 0, parts.ecn, parts.round};
}

std::optional<PublicKey> Gate::whom(const std::optional<PublicKey>& named) const {
  if (!sessions_) return named;
  const std::optional<PublicKey> who = named ? named : sessions_->trust().only_peer();
  if (!who || !sessions_->trust().may_connect(*who)) {
    throw std::invalid_argument(who ? "connect: the key " + to_base64(*who) + " is not trusted"
                                    : "connect: say which of the trusted peers this is");
  }
  if (sessions_->is_connected(*who)) {
    throw std::invalid_argument("connect: " + to_base64(*who) + " is connected to already");
  }
  return who;
}

void Gate::handle_timeout(TimePoint now, Slot slot, bool is_out_of_reach) {
  if (!sessions_) return;
  sessions_->set_out_of_reach(now, slot, is_out_of_reach);
  sessions_->handle_timeout(now, slot);
}

}  // namespace interneuron::peers
