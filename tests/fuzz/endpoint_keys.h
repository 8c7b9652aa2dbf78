// The keys of the hosts around an endpoint that encrypts, and what each does with them: it makes
// handshakes, answers those of the endpoint, and seals whatever a program has written, under any
// number. All but host 0 are trusted, so that what is sealed is what an insider may send.
//
// Keys are fixed, so that the same program gives the same bytes. Pure; thread-compatible.
#pragma once

#include <memory>
#include <optional>

#include "core/secure/handshake.h"
#include "core/secure/responder.h"
#include "core/secure/session.h"
#include "interneuron/endpoint.h"

namespace interneuron::fuzz {

class Keys {
 public:
  // `hosts`: how many there are; the last one makes and keeps its own sessions.
  explicit Keys(std::size_t hosts);

  // What the endpoint and the last host are given.
  std::shared_ptr<const Security> of_endpoint() const;
  std::shared_ptr<const Security> of_partner() const;
  PublicKey key_of(std::size_t host) const;

  // Whether this host, in this life, can seal what the endpoint opens.
  bool is_open(TimePoint now, std::size_t host, SessionId life) const;
  // Asks for a session over this path, in this life.
  Bytes initiation(TimePoint now, std::size_t host, LinkId path, SessionId life);
  // The endpoint has sent this to the host: what answers it, where it is an initiation; it may be
  // what ends the host's own.
  std::optional<Bytes> heard(TimePoint now, std::size_t host, LinkId nic, ByteView bytes);
  // A packet in the clear as this host sends it.
  std::optional<Bytes> seal(std::size_t host, ByteView plain) const;
  // What the endpoint has sealed for this host, in the clear.
  std::optional<Bytes> open(std::size_t host, ByteView sealed);
  // The token that a response brings.
  static std::optional<wire::Token> token_of(ByteView bytes);

 private:
  struct Agreed {
    TimePoint at{};
    SessionId life{};
    crypto::Session::Role role{};
    std::uint32_t theirs = 0;
    crypto::Split keys;
    crypto::Session receiving;
  };
  struct Host {
    crypto::KeyPair own;
    SessionId life{};
    std::optional<crypto::Initiator> initiator;
    std::optional<crypto::Responder> responder;
    std::optional<Agreed> agreed;
  };
  crypto::Initiator::Fresh fresh();
  void agree(TimePoint now, Host& host, SessionId life, crypto::Session::Role role,
             std::uint32_t theirs, const crypto::Split& keys);

  std::vector<Host> hosts_;
  // Those of all hosts; the responders refer to it.
  crypto::Trust trust_;
  crypto::Entropy entropy_;
  std::uint32_t next_index_ = 1;
  std::int64_t said_ns_ = 0;
};

}  // namespace interneuron::fuzz
