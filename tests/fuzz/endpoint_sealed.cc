// A World where packets are encrypted: what its hosts do with their keys, and what must hold of the
// packets that leave the endpoint.
#include "core/wire/packet.h"
#include "tests/fuzz/endpoint_world.h"
#include "tests/fuzz/finding.h"

namespace interneuron::fuzz {
namespace {

LinkId link_id(std::size_t link) { return LinkId{static_cast<std::uint16_t>(link)}; }

// Whose address this is.
std::optional<std::size_t> host_at(const Address& address, std::size_t link) {
  for (std::size_t host = 0; host < kHosts; ++host) {
    if (address_of(host, link) == address) return host;
  }
  return std::nullopt;
}

}  // namespace

Bytes World::as_sent(std::size_t host, std::size_t link, Bytes plain) {
  const auto header = wire::peek(plain);
  if (!keys_ || !header || host == kPartner) return plain;
  // Once, and again with the cookie that the first one may have brought.
  for (int i = 0; i < 2 && !keys_->is_open(now_, host, header->session); ++i) {
    if (!has_link(link) || handshakes_left_ == 0) break;
    --handshakes_left_;
    feed(host, link, keys_->initiation(now_, host, link_id(link), header->session));
  }
  const auto sealed = keys_->seal(host, plain);
  if (!sealed) return plain;
  inside_[*sealed] = std::move(plain);
  return *sealed;
}

// What the partner seals nobody else can open; but what is a token can be seen.
void World::note_sealed_proof(std::size_t host, Seen& from, ByteView bytes) const {
  const auto inside = inside_.find(Bytes(bytes.begin(), bytes.end()));
  if (inside != inside_.end()) return note_proof(from, inside->second);
  const auto header = wire::peek(bytes);
  if (host == kPartner && header && header->epoch == wire::kSealedEpoch &&
      header->type == wire::PacketType::kToken) {
    from.answered = true;
  }
}

void World::note_sealed(const Transmit& transmit, Seen& to, ByteView bytes) {
  const auto header = wire::peek(bytes);
  require(header.has_value(), "a packet without header leaves");
  const auto host = host_at(transmit.to, transmit.link.value);
  if (header->epoch == wire::kClearEpoch) {
    require(wire::is_handshake(header->type), "a packet leaves in the clear");
    if (const auto token = Keys::token_of(bytes)) to.tokens.insert(to.token.emplace(*token));
    if (!host || *host == kPartner) return;
    if (auto answer = keys_->heard(now_, *host, transmit.link, bytes)) {
      answers_.push_back({*host, transmit.link.value, std::move(*answer)});
    }
    return;
  }
  const std::uint32_t lane = wire::is_numbered(header->type) ? header->link.value : 0x10000U;
  require(numbers_.insert({header->session.value, lane, header->number}).second,
          "a number is sealed twice under one key");
  if (host && header->type == wire::PacketType::kChallenge) {
    if (const auto plain = keys_->open(*host, bytes)) note_challenge(to, *plain);
  }
}

void World::drain_answers() {
  while (!answers_.empty()) {
    const Answer answer = std::move(answers_.front());
    answers_.pop_front();
    endpoint_.handle_datagram(
        now_, {link_id(answer.link), address_of(answer.host, answer.link), answer.bytes, 0});
    drain_packets();
  }
}

}  // namespace interneuron::fuzz
