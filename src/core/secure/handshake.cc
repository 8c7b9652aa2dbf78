#include "core/secure/handshake.h"

#include <sodium.h>

#include <algorithm>
#include <cassert>

#include "core/secure/bytes.h"
#include "core/secure/cookie.h"
#include "core/wire/bytes.h"

namespace interneuron::crypto {
namespace {

constexpr std::string_view kPrologue = "interneuron 3";

SecretKey labelled_key(std::string_view label, const PublicKey& open) {
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, kKeyBytes);
  crypto_generichash_update(&state, raw(bytes_of(label)), label.size());
  crypto_generichash_update(&state, raw(ByteView(open)), open.size());
  SecretKey out;
  crypto_generichash_final(&state, target(out.writable()), kKeyBytes);
  return out;
}

}  // namespace

bool is_initiation_size(std::size_t bytes) {
  return bytes == kInitiationBytes || bytes == kLongInitiationBytes;
}

ByteView prologue() { return bytes_of(kPrologue); }

InitiationParts parts_of_initiation(ByteView packet) {
  assert(is_initiation_size(packet.size()));
  const std::size_t before_proof = packet.size() - 3 * kMacBytes;
  InitiationParts parts;
  parts.noise = packet.subspan(wire::kHeaderBytes, before_proof - wire::kHeaderBytes);
  parts.before_proof = packet.first(before_proof);
  parts.before_mac1 = packet.first(before_proof + kMacBytes);
  parts.before_mac2 = packet.first(before_proof + 2 * kMacBytes);
  parts.proof = packet.subspan(before_proof, kMacBytes);
  parts.mac1 = packet.subspan(before_proof + kMacBytes, kMacBytes);
  parts.mac2 = packet.last(kMacBytes);
  return parts;
}

ResponseParts parts_of_response(ByteView packet) {
  assert(packet.size() == kResponseBytes);
  const std::size_t before_token = kResponseBytes - wire::kTokenBytes - kMacBytes;
  return {packet.subspan(wire::kHeaderBytes, before_token - wire::kHeaderBytes),
          packet.subspan(before_token, wire::kTokenBytes), packet.last(kMacBytes),
          packet.first(kResponseBytes - kMacBytes)};
}

void put_hello(std::span<std::byte> out, const Hello& hello) {
  wire::Writer w(out);
  w.put(hello.life.value);
  w.put(hello.index);
  w.put(hello.unix_ns);
  w.put(hello.revocations_s);
  w.put(hello.ciphers);
  assert(w.ok());
}

Hello get_hello(ByteView bytes) {
  wire::Reader r(bytes);
  Hello hello;
  hello.life = SessionId{r.get<std::uint32_t>()};
  hello.index = r.get<std::uint32_t>();
  hello.unix_ns = r.get<std::int64_t>();
  hello.revocations_s = r.get<std::int64_t>();
  hello.ciphers = r.get<Ciphers>();
  return hello;
}

bool is_valid(const Hello& hello) {
  return hello.life.value != 0 && hello.index != 0 && hello.unix_ns >= 0 &&
         hello.unix_ns <= kLatestUnixNs;
}

SecretKey mac1_key(const PublicKey& responder) {
  return labelled_key("interneuron mac1", responder);
}

SecretKey cookie_key(const PublicKey& responder) {
  return labelled_key("interneuron cookie", responder);
}

SecretKey initiation_proof_key(const Noise& noise) {
  return noise.early_key("interneuron initiation");
}

SecretKey response_proof_key(const Noise& noise) { return noise.early_key("interneuron response"); }

Initiator::Initiator(const KeyPair& own, const TrustedPeer& peer, SessionId life,
                     ByteView credential)
    : own_(own),
      peer_(peer),
      life_(life),
      credential_(credential.begin(), credential.end()),
      mac1_key_(mac1_key(peer.key)),
      cookie_key_(cookie_key(peer.key)) {}

void Initiator::begin(TimePoint now) {
  if (is_trying()) return;
  next_try_ = began_at_ = now;
  retry_ = kFirstRetry;
}

void Initiator::stop() {
  next_try_.reset();
  noise_.reset();
}

void Initiator::tried(TimePoint now) {
  next_try_ = now + retry_;
  retry_ = std::min<Duration>(2 * retry_, now - began_at_ < kHurry ? kHurriedRetry : kLastRetry);
  ++try_;
}

void Initiator::hurry(TimePoint now) {
  if (is_trying()) next_try_ = std::min(*next_try_, now);
}

bool Initiator::needs_message(TimePoint now) const {
  return !noise_ || now - made_at_ >= kMessageLife;
}

bool Initiator::make_message(TimePoint now, const Fresh& fresh) {
  noise_ = Noise::initiator(Noise::Pattern::kIkPsk2, prologue(), own_, key_pair_of(fresh.ephemeral),
                            peer_.key);
  noise_->set_shared(peer_.shared);
  Bytes payload(kHelloBytes);
  put_hello(payload, {life_, fresh.index, fresh.unix_ns, fresh.revocations_s, fresh.ciphers});
  payload.insert(payload.end(), credential_.begin(), credential_.end());
  message_.resize(kFirstMessageBytes + payload.size());
  if (!noise_->write_first(message_, payload)) {
    stop();
    return false;
  }
  proof_key_ = initiation_proof_key(*noise_);
  ciphers_ = fresh.ciphers;
  index_ = fresh.index;
  made_at_ = now;
  try_ = 1;
  return true;
}

std::size_t Initiator::write(LinkId path, std::span<std::byte> out) const {
  const std::size_t size = wire::kHeaderBytes + message_.size() + 3 * kMacBytes;
  assert(noise_ && out.size() >= size);
  const std::span<std::byte> packet = out.first(size);
  const wire::PacketHeader header{
      wire::PacketType::kInitiation, path, wire::kClearEpoch, SessionId{index_}, try_, 0};
  wire::write_header(packet, header);
  std::ranges::copy(message_, packet.begin() + wire::kHeaderBytes);
  const InitiationParts parts = parts_of_initiation(packet);
  const auto put = [&packet](ByteView at, const Mac& mac) {
    std::ranges::copy(mac, packet.begin() + (at.data() - packet.data()));
  };
  put(parts.proof, mac_of(proof_key_, parts.before_proof));
  put(parts.mac1, mac_of(mac1_key_, parts.before_mac1));
  const auto cookie = std::ranges::find(cookies_, path, &Cookie::path);
  put(parts.mac2, cookie == cookies_.end() ? Mac{} : mac_of(cookie->key, parts.before_mac2));
  return size;
}

std::optional<Initiator::Answer> Initiator::take_response(ByteView packet) {
  if (!noise_ || packet.size() != kResponseBytes) return std::nullopt;
  const ResponseParts parts = parts_of_response(packet);
  const SecretKey proof_key = response_proof_key(*noise_);
  if (!is_mac(parts.proof, proof_key, parts.before_proof)) return std::nullopt;
  // What is not to be read leaves the handshake as it was.
  Noise noise = *noise_;
  std::array<std::byte, kHelloBytes> hello{};
  if (!noise.read_second(parts.noise, hello)) return std::nullopt;
  const Hello theirs = get_hello(hello);
  const Answer answer{theirs, noise.split(common_cipher(ciphers_, theirs.ciphers))};
  if (!is_valid(answer.theirs)) return std::nullopt;
  answered_key_ = proof_key;
  answered_index_ = index_;
  tokens_.clear();
  cookies_.clear();
  stop();
  return answer;
}

std::optional<wire::Token> Initiator::token_of(ByteView packet) {
  const auto header = wire::peek(packet);
  if (!header || packet.size() != kResponseBytes || header->session.value != answered_index_) {
    return std::nullopt;
  }
  const ResponseParts parts = parts_of_response(packet);
  if (!is_mac(parts.proof, answered_key_, parts.before_proof)) return std::nullopt;
  auto taken = std::ranges::find(tokens_, header->link, &Taken::path);
  if (taken == tokens_.end()) {
    taken = tokens_.insert(tokens_.end(), {header->link, header->number});
  } else if (header->number <= taken->newest_try) {
    return std::nullopt;
  }
  taken->newest_try = header->number;
  wire::Token token{};
  std::ranges::copy(parts.token, token.begin());
  return token;
}

bool Initiator::take_cookie(TimePoint now, const wire::PacketHeader& header, ByteView packet) {
  if (!noise_ || packet.size() != kCookieBytes || header.session.value != index_ ||
      header.number > try_) {
    return false;
  }
  // The mac1 of the copy that is answered.
  const std::uint64_t newest = try_;
  std::array<std::byte, kLongInitiationBytes> copy{};
  try_ = header.number;
  const ByteView sent = std::span(copy).first(write(header.link, copy));
  try_ = newest;
  const auto key = open_cookie(cookie_key_, parts_of_initiation(sent).mac1, packet);
  if (!key) return false;
  auto known = std::ranges::find(cookies_, header.link, &Cookie::path);
  if (known == cookies_.end()) {
    if (cookies_.size() >= wire::kMaxReports) cookies_.erase(cookies_.begin());
    known = cookies_.insert(cookies_.end(), {header.link, {}, 0});
  }
  if (known->index != index_) next_try_ = std::min(next_try_.value_or(now), now);
  *known = {header.link, *key, index_};
  return true;
}

}  // namespace interneuron::crypto
