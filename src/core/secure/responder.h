// The side of a handshake that is asked: who may have a session here, and what an answer costs.
//
// Owned and fed by Sessions with every initiation that comes in: any bytes from anywhere. What an
// attacker could try, and what he gets:
//   - to scan: nothing is answered that does not know our public key (mac1);
//   - to record an initiation and send it again: each copy of each try is answered once, no message
//     that is not newer than the newest one of its key, and none of the last kMaxSeen is looked at
//     again;
//   - to make this host multiply points (0.27 ms an answer): kFreely a second for everybody;
//     beyond that only for whoever proves that he receives at his address (Cookies), at most
//     kPerSource of one host and kUnderLoad in all;
//   - to make it send to somebody else: every answer is smaller than what it answers, and at most
//     kMaxWaiting wait.
// A host is known by its key alone; nothing is kept of anybody who has not shown one that is
// trusted. Constant memory but for the newest time of each trusted key. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/base/rate_limit.h"
#include "core/base/source_limit.h"
#include "core/secure/cookie.h"
#include "core/secure/handshake.h"
#include "core/secure/noise.h"
#include "core/secure/trust.h"
#include "interneuron/endpoint.h"

namespace interneuron::crypto {

class Responder {
 public:
  // Answers a second that are given without asking for a cookie. No measurement behind this value:
  // a fleet that joins one by one needs less, and 50 cost a seventieth of a processor.
  static constexpr std::uint32_t kFreely = 50;
  // Handshakes a second in all while cookies are asked for, of which those of strangers cost 0.11
  // ms, a tenth of a processor, and those that are answered 0.27 ms. What is above is refused by
  // chance, so fewer would keep newcomers waiting beside a flood from many addresses.
  static constexpr std::uint32_t kUnderLoad = 1000;
  // The same at a door, which computes what strangers cost for each and answers none: so many cost
  // it what kUnderLoad cost whoever answers.
  static constexpr std::uint32_t kAtTheDoor = 2500;
  // The same for one host while cookies are asked for: how far apart, and how many at once. These
  // are WireGuard's (messages.h and ratelimiter.c of Linux).
  static constexpr Duration kPerSource = std::chrono::milliseconds(50);
  static constexpr int kSourceBurst = 5;
  // Cookies a second: about a tenth of a processor for sending them.
  static constexpr std::uint32_t kCookies = 20'000;
  // Answers that wait to leave: the cookies of a tenth of a second, since the loop of a loaded host
  // may come to run that rarely. They take 0.6 MB.
  static constexpr std::size_t kMaxWaiting = 2048;
  // Messages whose further copies are known, the oldest makes room: ten seconds of kFreely, and
  // more than half a second of kUnderLoad.
  static constexpr std::size_t kMaxAnswered = 512;
  // Messages of hosts that are trusted, known by their ephemeral keys, whatever became of them:
  // 16 KB, so that what was recorded in hours of a vehicle's traffic costs no work.
  static constexpr std::size_t kMaxSeen = 2048;

  // `trust`: who may have a session; outlives this. `shard`: the door judges everybody and answers
  // nobody but with cookies; the shards answer whoever it hands on to them, and limit nobody again.
  Responder(const KeyPair& own, SessionId life, const Trust& trust, const Shard& shard = {});

  enum class Verdict : std::uint8_t {
    // It is answered by nobody.
    kRefused,
    // The next poll() answers it: with a cookie, or as a further copy of one that was accepted.
    kAnswered,
    // It may be new: accept() does the rest, at the door shard_for().
    kNew,
    // A further copy of one that was handed on to the shard elsewhere().
    kElsewhere,
  };
  Verdict take(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
               Entropy& entropy);

  // What a host that is trusted asks for.
  struct Accepted {
    PublicKey who{};
    Hello theirs;
    Split keys;
  };
  // Answers a packet of which take() has said kNew. Nothing where it is refused.
  std::optional<Accepted> accept(TimePoint now, const wire::PacketHeader& header,
                                 const Datagram& datagram, const Initiator::Fresh& fresh);

  // At the door: which shard is to answer a packet of which take() has said kNew, the same one for
  // each key; 0: none, it is refused.
  std::uint8_t shard_for(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
                         const Initiator::Fresh& fresh);
  std::uint8_t elsewhere() const { return elsewhere_; }

  // Who is to be answered next, for whom the token is to be made; and the answer with it.
  struct Next {
    LinkId nic{};
    Address to{};
    LinkId path{};
    // The number by which we know the session that is agreed on; 0: it is a cookie.
    std::uint32_t index = 0;
  };
  std::optional<Next> next() const;
  std::size_t write(std::span<std::byte> out, const wire::Token& token);
  void remove_link(LinkId nic);

 private:
  struct Copy {
    LinkId path{};
    std::uint64_t newest_try = 0;
  };
  // A message that was accepted.
  struct Answered {
    std::array<std::byte, kKeyBytes> ephemeral{};
    TimePoint at{};
    std::uint32_t theirs = 0;
    std::uint32_t ours = 0;
    // Which shard it was handed on to; 0: it was answered here.
    std::uint8_t shard = 0;
    SecretKey initiation_proof;
    SecretKey response_proof;
    std::array<std::byte, kSecondMessageBytes + kHelloBytes> message{};
    // Few.
    std::vector<Copy> copies;
  };
  struct Waiting {
    Next next;
    wire::PacketHeader header;
    // Where it is a cookie.
    Mac mac1{};
    SecretKey cookie;
    SecretKey nonce;
    // Where it is a response.
    std::array<std::byte, kSecondMessageBytes + kHelloBytes> message{};
    SecretKey proof;
  };
  // What is known of a host that has shown a key that is trusted.
  struct Known {
    // The newest time that it has said.
    std::int64_t newest = 0;
    std::uint8_t shard = 0;
  };
  // The first message of a host that is trusted.
  struct First {
    Noise noise;
    SecretKey shared;
    Hello theirs;
    Answered answer;
    // Its place in known_.
    Known* of_key = nullptr;
  };
  Answered* answered(TimePoint now, ByteView packet);
  // What a packet asks for that may be new. Nothing where it is refused.
  std::optional<First> read_first(TimePoint now, const wire::PacketHeader& header,
                                  const Datagram& datagram, const Initiator::Fresh& fresh);
  void keep(Answered&& answer);
  // Whether no copy of this path and of this try or a later one has come before.
  static bool is_new_copy(Answered& of, const wire::PacketHeader& header);
  bool answer_copy(Answered& to, const wire::PacketHeader& header, const Datagram& datagram);
  bool was_seen(ByteView packet) const;
  void note_seen(ByteView packet);
  bool may_ask(TimePoint now, const Datagram& datagram, const InitiationParts& parts, bool& cookie);
  void queue_cookie(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
                    ByteView mac1, Entropy& entropy);

  KeyPair own_;
  SessionId life_;
  const Trust& trust_;
  SecretKey mac1_key_;
  SecretKey cookie_key_;
  Shard shard_;
  std::map<PublicKey, Known> known_;
  // The shard that a key was given last, and that which a copy is for.
  std::uint8_t given_ = 0;
  std::uint8_t elsewhere_ = 0;
  Cookies cookies_;
  RateLimit freely_;
  RateLimit under_load_;
  RateLimit cookies_sent_;
  SourceLimit sources_;
  std::deque<Answered> answered_;
  // The first bytes of ephemeral keys; a ring.
  std::vector<std::uint64_t> seen_;
  std::size_t seen_at_ = 0;
  std::deque<Waiting> waiting_;
};

}  // namespace interneuron::crypto
