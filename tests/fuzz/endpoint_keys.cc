#include "tests/fuzz/endpoint_keys.h"

#include <map>

#include "lab/sim/trust.h"
#include "tests/fuzz/finding.h"

namespace interneuron::fuzz {
namespace {

constexpr int kEndpointKey = 1;
constexpr int kFirstHostKey = 10;
constexpr int kEntropyKey = 99;

// Computed once.
const crypto::KeyPair& pair_of(int number) {
  static std::map<int, crypto::KeyPair> pairs;
  const auto known = pairs.find(number);
  if (known != pairs.end()) return known->second;
  return pairs.emplace(number, crypto::key_pair_of(sim::secret_key(number))).first->second;
}

int number_of(std::size_t host) { return kFirstHostKey + static_cast<int>(host); }
// What programs write as their sender, too.
SessionId life_of(std::size_t host) {
  return SessionId{static_cast<std::uint32_t>(100 + 10 * host)};
}

}  // namespace

Keys::Keys(std::size_t hosts)
    : hosts_(hosts),
      trust_(*sim::security_of(number_of(0), {kEndpointKey})),
      entropy_(sim::secret_key(kEntropyKey)) {
  for (std::size_t i = 0; i < hosts; ++i) {
    hosts_[i].own = pair_of(number_of(i));
    hosts_[i].life = life_of(i);
    hosts_[i].responder.emplace(hosts_[i].own, hosts_[i].life, trust_);
  }
}

std::shared_ptr<const Security> Keys::of_endpoint() const {
  auto out = std::make_shared<Security>(*sim::security_of(kEndpointKey, {}));
  for (std::size_t i = 1; i < hosts_.size(); ++i) out->peers.push_back({hosts_[i].own.open, {}});
  return out;
}

std::shared_ptr<const Security> Keys::of_partner() const {
  return sim::security_of(number_of(hosts_.size() - 1), {kEndpointKey});
}

PublicKey Keys::key_of(std::size_t host) const { return hosts_[host].own.open; }

crypto::Initiator::Fresh Keys::fresh() { return {next_index_++, entropy_.draw_key(), ++said_ns_}; }

bool Keys::is_open(TimePoint now, std::size_t host, SessionId life) const {
  const auto& agreed = hosts_[host].agreed;
  return agreed && agreed->life == life && now - agreed->at < crypto::kRekeyAfter;
}

Bytes Keys::initiation(TimePoint now, std::size_t host, LinkId path, SessionId life) {
  Host& from = hosts_[host];
  const bool goes_on = from.initiator && from.initiator->is_trying() && from.life == life;
  if (!goes_on) {
    from.initiator.emplace(from.own, TrustedPeer{pair_of(kEndpointKey).open, {}}, life);
    from.initiator->begin(now);
    from.life = life;
  }
  if (from.initiator->needs_message(now)) {
    require(from.initiator->make_message(now, fresh()), "no message can be made");
  }
  Bytes out(crypto::kInitiationBytes);
  from.initiator->write(path, out);
  from.initiator->tried(now);
  return out;
}

void Keys::agree(TimePoint now, Host& host, SessionId life, crypto::Session::Role role,
                 std::uint32_t theirs, const crypto::Split& keys) {
  host.agreed.emplace(
      Agreed{now, life, role, theirs, keys, crypto::Session(now, role, theirs, keys)});
}

std::optional<Bytes> Keys::heard(TimePoint now, std::size_t host, LinkId nic, ByteView bytes) {
  Host& at = hosts_[host];
  const auto header = wire::peek(bytes);
  if (!header || header->epoch != wire::kClearEpoch) return std::nullopt;
  if (header->type == wire::PacketType::kInitiation) {
    const Datagram datagram{nic, {}, bytes};
    const auto verdict = at.responder->take(now, *header, datagram, entropy_);
    if (verdict == crypto::Responder::Verdict::kNew) {
      const auto made = fresh();
      const auto accepted = at.responder->accept(now, *header, datagram, made);
      if (!accepted) return std::nullopt;
      agree(now, at, life_of(host), crypto::Session::Role::kResponder, accepted->theirs.index,
            accepted->keys);
    }
    if (!at.responder->next()) return std::nullopt;
    Bytes out(kMaxDatagramBytes);
    out.resize(at.responder->write(out, {}));
    return out;
  }
  if (!at.initiator) return std::nullopt;
  if (header->type == wire::PacketType::kCookie) {
    at.initiator->take_cookie(now, *header, bytes);
  } else if (const auto answer = at.initiator->take_response(bytes)) {
    agree(now, at, at.life, crypto::Session::Role::kInitiator, answer->theirs.index, answer->keys);
  }
  return std::nullopt;
}

// A session that has sealed nothing seals any number: insiders may use one as often as they like.
std::optional<Bytes> Keys::seal(std::size_t host, ByteView plain) const {
  const auto& agreed = hosts_[host].agreed;
  if (!agreed || plain.size() < wire::kPacketOverhead) return std::nullopt;
  Bytes out(plain.begin(), plain.end());
  crypto::Session session(agreed->at, agreed->role, agreed->theirs, agreed->keys);
  if (!session.seal(out)) return std::nullopt;
  return out;
}

std::optional<Bytes> Keys::open(std::size_t host, ByteView sealed) {
  const auto header = wire::peek(sealed);
  auto& agreed = hosts_[host].agreed;
  if (!header || !agreed) return std::nullopt;
  Bytes out(kMaxDatagramBytes);
  if (agreed->receiving.open(*header, sealed, out) != crypto::Session::Opened::kOk) {
    return std::nullopt;
  }
  out.resize(sealed.size());
  return out;
}

std::optional<wire::Token> Keys::token_of(ByteView bytes) {
  const auto header = wire::peek(bytes);
  const bool is_response = header && header->epoch == wire::kClearEpoch &&
                           header->type == wire::PacketType::kResponse &&
                           bytes.size() == crypto::kResponseBytes;
  if (!is_response) return std::nullopt;
  wire::Token out{};
  std::ranges::copy(crypto::parts_of_response(bytes).token, out.begin());
  return out;
}

}  // namespace interneuron::fuzz
