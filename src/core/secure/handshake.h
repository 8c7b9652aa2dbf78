// The packets by which two hosts agree on a session, and the side that asks for one.
//
//   initiation   header, first message of Noise, proof, mac1, mac2   from whoever connected
//   response     header, second message of Noise, token, proof       from whoever was connected to
//   cookie       header, nonce, sealed cookie                        the same, under load
//
// An initiation leaves over all paths at once, and the first answer counts. Its copies differ in
// path and try, which stand in the header, and so in their proofs: a code over the whole packet
// under a key that only the two sides can compute. So a copy that was recorded and is sent again is
// told from those of the sender's other paths, and answered by nobody.
//
// mac1 and mac2 are WireGuard's ("WireGuard: Next Generation Kernel Network Tunnel", Donenfeld):
// mac1 shows that the sender knows whom he asks, so that a scanner of ports is never answered, and
// mac2 that he receives at the address that he sends from, which is asked for under load alone.
// docs/wire_format.md is the authority on the layout.
//
// Initiator is owned and fed by Sessions, one for each peer that we connect to: write() when it is
// due, take_response() and take_cookie() with any bytes from anywhere. What is not authentic
// changes nothing. Constant memory but for the cookies of kMaxReports paths. Pure;
// thread-compatible.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/secure/kdf.h"
#include "core/secure/noise.h"
#include "core/secure/session.h"
#include "core/wire/packet.h"
#include "interneuron/security.h"
#include "interneuron/time.h"

namespace interneuron::crypto {

inline constexpr std::size_t kCookieNonceBytes = 24;

// What an initiation and a response say beside their keys.
struct Hello {
  // This life of the endpoint that sends it.
  SessionId life{};
  // The number by which the sender wants to be told which keys a packet was sealed with.
  std::uint32_t index = 0;
  // When it was made, ns since 1970 by the sender's reckoning. Of an initiation: above that of each
  // one before with the same key.
  std::int64_t unix_ns = 0;
  // When the newest list of revocations was issued that the sender knows, s since 1970; 0: none.
  std::int64_t revocations_s = 0;
  // Both hosts say what they can and take the best that both have (common_cipher()): nobody can
  // change what they say without ending the handshake.
  Ciphers ciphers = 0;
};
inline constexpr std::size_t kHelloBytes = 25;
// The latest time that a hello may say, which is in the year 2116: whoever counts on from there
// does not overflow.
inline constexpr std::int64_t kLatestUnixNs = std::int64_t{1} << 62U;
// Whether the other side may say this; its key proves who says it, and nothing of what is said.
bool is_valid(const Hello& hello);

// An initiation, without a credential and with one behind the hello.
inline constexpr std::size_t kInitiationBytes =
    wire::kHeaderBytes + kFirstMessageBytes + kHelloBytes + 3 * kMacBytes;
inline constexpr std::size_t kLongInitiationBytes = kInitiationBytes + kCredentialBytes;
bool is_initiation_size(std::size_t bytes);
inline constexpr std::size_t kResponseBytes =
    wire::kHeaderBytes + kSecondMessageBytes + kHelloBytes + wire::kTokenBytes + kMacBytes;
inline constexpr std::size_t kCookieBytes =
    wire::kHeaderBytes + kCookieNonceBytes + kMacBytes + kAeadTagBytes;
// Nobody is answered with more than he has sent.
static_assert(kResponseBytes < kInitiationBytes && kCookieBytes < kInitiationBytes);

// Where the parts of an initiation and of a response are.
struct InitiationParts {
  ByteView noise;
  ByteView proof;
  ByteView mac1;
  ByteView mac2;
  // What the three are computed of, each over all before it.
  ByteView before_proof;
  ByteView before_mac1;
  ByteView before_mac2;
};
InitiationParts parts_of_initiation(ByteView packet);
struct ResponseParts {
  ByteView noise;
  ByteView token;
  ByteView proof;
  ByteView before_proof;
};
ResponseParts parts_of_response(ByteView packet);

void put_hello(std::span<std::byte> out, const Hello& hello);
Hello get_hello(ByteView bytes);

// The keys of mac1 and of cookies to this host; no secrets, they only bind to whom is meant.
SecretKey mac1_key(const PublicKey& responder);
SecretKey cookie_key(const PublicKey& responder);
// Both sides know these once the first message was read.
SecretKey initiation_proof_key(const Noise& noise);
SecretKey response_proof_key(const Noise& noise);
// What both sides must agree on beside their keys: the protocol and its version.
ByteView prologue();

class Initiator {
 public:
  // The same message is sent again for so long; then a new one is made. Responders remember their
  // answers for as long (Responder).
  static constexpr Duration kMessageLife = std::chrono::seconds(5);
  // How far the tries of a message are apart: the first ones so that one lost packet does not cost
  // the time in which a peer is believed to be dead, later ones twice as far each time, up to
  // WireGuard's REKEY_TIMEOUT. No measurement behind the first value.
  static constexpr Duration kFirstRetry = std::chrono::milliseconds(100);
  // For kHurry they are no further apart than this: under a flood a responder takes a part of what
  // comes, and a vehicle should not be long gone when it is its turn.
  static constexpr Duration kHurriedRetry = std::chrono::milliseconds(200);
  static constexpr Duration kHurry = std::chrono::seconds(2);
  static constexpr Duration kLastRetry = std::chrono::seconds(5);

  // `credential`: ours, of kCredentialBytes, or nothing.
  Initiator(const KeyPair& own, const TrustedPeer& peer, SessionId life, ByteView credential = {});

  // A session is wanted from now on; nothing happens where one is being asked for.
  void begin(TimePoint now);
  // It is wanted no more.
  void stop();
  bool is_trying() const { return next_try_.has_value(); }
  std::optional<TimePoint> next_timeout() const { return next_try_; }
  // Whether the copies of a try are to leave now; tried() when they all have.
  bool is_due(TimePoint now) const { return next_try_ && *next_try_ <= now; }
  void tried(TimePoint now);
  // The next try, if there is to be one, leaves at once.
  void hurry(TimePoint now);

  // What a new message is made of, where needs_message().
  struct Fresh {
    std::uint32_t index = 0;
    SecretKey ephemeral;
    std::int64_t unix_ns = 0;
    std::int64_t revocations_s = 0;
    Ciphers ciphers = 0;
  };
  bool needs_message(TimePoint now) const;
  // False: the peer's key is one that nobody can have.
  bool make_message(TimePoint now, const Fresh& fresh);
  // The index of the message under way; 0: there is none.
  std::uint32_t index() const { return noise_ ? index_ : 0; }
  // Writes the copy for this path and returns its size.
  std::size_t write(LinkId path, std::span<std::byte> out) const;

  struct Answer {
    Hello theirs;
    Split keys;
  };
  // The response to the message under way; nothing where it is none. Ends the trying.
  std::optional<Answer> take_response(ByteView packet);
  // The token that an authentic response to the newest message that was answered brought over the
  // path of its header: also those to its other copies, but each once and none that is older than
  // one before it.
  std::optional<wire::Token> token_of(ByteView packet);
  // False where it is none for a copy of the message under way. The first one that a path gets for
  // a message lets the next try leave at once.
  bool take_cookie(TimePoint now, const wire::PacketHeader& header, ByteView packet);

 private:
  struct Cookie {
    LinkId path{};
    SecretKey key;
    // The index of the message that it was given for.
    std::uint32_t index = 0;
  };
  KeyPair own_;
  TrustedPeer peer_;
  SessionId life_;
  Bytes credential_;
  SecretKey mac1_key_;
  SecretKey cookie_key_;
  std::optional<Noise> noise_;
  // The message under way, and what it was made with.
  Bytes message_;
  SecretKey proof_key_;
  Ciphers ciphers_ = 0;
  std::uint32_t index_ = 0;
  TimePoint made_at_{};
  std::uint64_t try_ = 0;
  std::optional<TimePoint> next_try_;
  Duration retry_ = kFirstRetry;
  TimePoint began_at_{};
  // The newest message that was answered.
  SecretKey answered_key_;
  std::uint32_t answered_index_ = 0;
  struct Taken {
    LinkId path{};
    std::uint64_t newest_try = 0;
  };
  std::vector<Taken> tokens_;
  std::vector<Cookie> cookies_;
};

}  // namespace interneuron::crypto
