#include "core/secure/responder.h"

#include <sodium.h>

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/secure/bytes.h"

namespace interneuron::crypto {
namespace {

constexpr Duration kBurst = std::chrono::seconds(1);
constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr Duration kCookieBurst = std::chrono::milliseconds(100);

// What an initiation is known by: the first bytes of its ephemeral key.
std::uint64_t name_of_ephemeral(ByteView packet) {
  std::uint64_t name = 0;
  std::memcpy(&name, packet.subspan(wire::kHeaderBytes).data(), sizeof(name));
  return name;
}

}  // namespace

Responder::Responder(const KeyPair& own, SessionId life, const Trust& trust, const Shard& shard)
    : own_(own),
      life_(life),
      trust_(trust),
      mac1_key_(mac1_key(own.open)),
      cookie_key_(cookie_key(own.open)),
      shard_(shard),
      freely_(kFreely, kBurst),
      under_load_(shard.is_door() ? kAtTheDoor : kUnderLoad, kBurst),
      cookies_sent_(kCookies, kCookieBurst),
      sources_(kPerSource, kSourceBurst) {}

Responder::Answered* Responder::answered(TimePoint now, ByteView packet) {
  while (!answered_.empty() && now - answered_.front().at >= Initiator::kMessageLife) {
    answered_.pop_front();
  }
  const ByteView ephemeral = packet.subspan(wire::kHeaderBytes, kKeyBytes);
  const auto it = std::ranges::find_if(
      answered_, [&](const Answered& a) { return std::ranges::equal(a.ephemeral, ephemeral); });
  return it == answered_.end() ? nullptr : &*it;
}

bool Responder::was_seen(ByteView packet) const {
  return std::ranges::find(seen_, name_of_ephemeral(packet)) != seen_.end();
}

void Responder::note_seen(ByteView packet) {
  if (seen_.size() < kMaxSeen) {
    seen_.push_back(name_of_ephemeral(packet));
  } else {
    seen_[seen_at_] = name_of_ephemeral(packet);
    seen_at_ = (seen_at_ + 1) % kMaxSeen;
  }
}

bool Responder::is_new_copy(Answered& of, const wire::PacketHeader& header) {
  const auto known = std::ranges::find(of.copies, header.link, &Copy::path);
  if (known != of.copies.end()) {
    if (header.number <= known->newest_try) return false;
    known->newest_try = header.number;
  } else {
    if (of.copies.size() >= wire::kMaxReports) return false;
    of.copies.push_back({header.link, header.number});
  }
  return true;
}

bool Responder::answer_copy(Answered& to, const wire::PacketHeader& header,
                            const Datagram& datagram) {
  if (waiting_.size() >= kMaxWaiting || !is_new_copy(to, header)) return false;
  Waiting& answer = waiting_.emplace_back();
  answer.next = {datagram.link, datagram.from, header.link, to.ours};
  answer.header = {wire::PacketType::kResponse, header.link,   wire::kClearEpoch,
                   SessionId{to.theirs},        header.number, 0};
  answer.message = to.message;
  answer.proof = to.response_proof;
  return true;
}

// Freely as long as few ask; else only whoever has shown that he receives at his address. `cookie`:
// he is to be given the means for that.
bool Responder::may_ask(TimePoint now, const Datagram& datagram, const InitiationParts& parts,
                        bool& cookie) {
  // The door has let it in.
  if (shard_.index > 0 || freely_.take(now)) return true;
  // Most of a flood has no mac2 at all.
  const bool has_mac2 =
      std::ranges::any_of(parts.mac2, [](std::byte b) { return b != std::byte{0}; });
  if (!has_mac2 ||
      !cookies_.is_from(now, datagram.link, datagram.from, parts.mac2, parts.before_mac2)) {
    cookie = true;
    return false;
  }
  return sources_.allow(now, datagram.from) && under_load_.take(now);
}

Responder::Verdict Responder::take(TimePoint now, const wire::PacketHeader& header,
                                   const Datagram& datagram, Entropy& entropy) {
  if (!is_initiation_size(datagram.bytes.size())) return Verdict::kRefused;
  const InitiationParts parts = parts_of_initiation(datagram.bytes);
  if (!is_mac(parts.mac1, mac1_key_, parts.before_mac1)) return Verdict::kRefused;
  if (Answered* const known = answered(now, datagram.bytes)) {
    if (!is_mac(parts.proof, known->initiation_proof, parts.before_proof)) return Verdict::kRefused;
    elsewhere_ = known->shard;
    if (elsewhere_ != 0) {
      return is_new_copy(*known, header) ? Verdict::kElsewhere : Verdict::kRefused;
    }
    return answer_copy(*known, header, datagram) ? Verdict::kAnswered : Verdict::kRefused;
  }
  if (was_seen(datagram.bytes)) return Verdict::kRefused;
  bool cookie = false;
  if (may_ask(now, datagram, parts, cookie)) return Verdict::kNew;
  if (!cookie || waiting_.size() >= kMaxWaiting || !cookies_sent_.take(now)) {
    return Verdict::kRefused;
  }
  queue_cookie(now, header, datagram, parts.mac1, entropy);
  return Verdict::kAnswered;
}

void Responder::queue_cookie(TimePoint now, const wire::PacketHeader& header,
                             const Datagram& datagram, ByteView mac1, Entropy& entropy) {
  Waiting& answer = waiting_.emplace_back();
  answer.next = {datagram.link, datagram.from, header.link, 0};
  answer.header = header;
  std::ranges::copy(mac1, answer.mac1.begin());
  answer.cookie = cookies_.of(now, datagram.link, datagram.from, entropy);
  answer.nonce = entropy.draw_key();
}

std::optional<Responder::First> Responder::read_first(TimePoint now,
                                                      const wire::PacketHeader& header,
                                                      const Datagram& datagram,
                                                      const Initiator::Fresh& fresh) {
  const InitiationParts parts = parts_of_initiation(datagram.bytes);
  Noise noise = Noise::responder(Noise::Pattern::kIkPsk2, prologue(), own_, fresh.ephemeral);
  Bytes payload(parts.noise.size() - kFirstMessageBytes);
  if (!noise.read_first(parts.noise, payload)) return std::nullopt;
  Answered answer;
  answer.initiation_proof = initiation_proof_key(noise);
  if (!is_mac(parts.proof, answer.initiation_proof, parts.before_proof)) return std::nullopt;
  const auto shared = trust_.may_join(noise.remote(), std::span(payload).subspan(kHelloBytes),
                                      fresh.unix_ns / kNsPerSecond);
  if (!shared) return std::nullopt;
  // Not before: whoever has overheard a message could keep its owner out with it.
  note_seen(datagram.bytes);
  const Hello theirs = get_hello(payload);
  if (!is_valid(theirs) || theirs.index != header.session.value) return std::nullopt;
  const auto [known, is_new] = known_.try_emplace(noise.remote());
  if (!is_new && theirs.unix_ns <= known->second.newest) return std::nullopt;
  known->second.newest = theirs.unix_ns;
  std::ranges::copy(parts.noise.first(kKeyBytes), answer.ephemeral.begin());
  answer.at = now;
  answer.theirs = theirs.index;
  return First{std::move(noise), *shared, theirs, std::move(answer), &known->second};
}

void Responder::keep(Answered&& answer) {
  if (answered_.size() >= kMaxAnswered) answered_.pop_front();
  answered_.push_back(std::move(answer));
}

std::optional<Responder::Accepted> Responder::accept(TimePoint now,
                                                     const wire::PacketHeader& header,
                                                     const Datagram& datagram,
                                                     const Initiator::Fresh& fresh) {
  auto first = read_first(now, header, datagram, fresh);
  if (!first) return std::nullopt;
  Noise& noise = first->noise;
  Answered& answer = first->answer;
  answer.response_proof = response_proof_key(noise);
  noise.set_shared(first->shared);
  std::array<std::byte, kHelloBytes> hello{};
  put_hello(hello, {life_, fresh.index, fresh.unix_ns, fresh.revocations_s, fresh.ciphers});
  if (!noise.write_second(answer.message, hello)) return std::nullopt;
  answer.ours = fresh.index;
  keep(std::move(answer));
  answer_copy(answered_.back(), header, datagram);
  return Accepted{noise.remote(), first->theirs,
                  noise.split(common_cipher(fresh.ciphers, first->theirs.ciphers))};
}

// Keys get shards in turns, so that these have as many.
std::uint8_t Responder::shard_for(TimePoint now, const wire::PacketHeader& header,
                                  const Datagram& datagram, const Initiator::Fresh& fresh) {
  auto first = read_first(now, header, datagram, fresh);
  if (!first) return 0;
  std::uint8_t& shard = first->of_key->shard;
  if (shard == 0) shard = given_ = static_cast<std::uint8_t>(given_ % shard_.count + 1);
  first->answer.shard = shard;
  keep(std::move(first->answer));
  is_new_copy(answered_.back(), header);
  return shard;
}

std::optional<Responder::Next> Responder::next() const {
  if (waiting_.empty()) return std::nullopt;
  return waiting_.front().next;
}

std::size_t Responder::write(std::span<std::byte> out, const wire::Token& token) {
  assert(!waiting_.empty());
  const Waiting answer = std::move(waiting_.front());
  waiting_.pop_front();
  if (answer.next.index == 0) {
    write_cookie(out, answer.header, answer.mac1, cookie_key_, answer.cookie, answer.nonce);
    return kCookieBytes;
  }
  const std::span<std::byte> packet = out.first(kResponseBytes);
  wire::write_header(packet, answer.header);
  auto at = std::ranges::copy(answer.message, packet.begin() + wire::kHeaderBytes).out;
  at = std::ranges::copy(token, at).out;
  std::ranges::copy(mac_of(answer.proof, packet.first(kResponseBytes - kMacBytes)), at);
  return kResponseBytes;
}

void Responder::remove_link(LinkId nic) {
  std::erase_if(waiting_, [nic](const Waiting& w) { return w.next.nic == nic; });
}

}  // namespace interneuron::crypto
