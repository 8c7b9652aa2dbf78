// What Sessions keeps of each session, and of each peer. Plain values.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "core/secure/handshake.h"
#include "core/secure/session.h"
#include "interneuron/security.h"
#include "interneuron/time.h"

namespace interneuron::crypto {

// A session with a host. `owner`: the peer (Sessions::Owner) that this host is; nothing: it has not
// shown where it is.
struct LiveSession {
  LiveSession(const PublicKey& host, const Hello& hello, Session&& s)
      : who(host), life(hello.life), revocations_s(hello.revocations_s), session(std::move(s)) {}
  PublicKey who{};
  SessionId life{};
  // The list of revocations that the other side knows.
  std::int64_t revocations_s = 0;
  std::optional<std::uint32_t> owner;
  Session session;
};

// What a peer has: numbers of sessions, 0 for none.
struct PeerKeys {
  // A handshake for want of packets begins no sooner after one that was answered: the other side
  // has to get our first packet and answer it, and may be about to. Twice as long after each that
  // led to nothing, up to Initiator::kLastRetry. No measurement behind this value: it has to be
  // above the round trips of networks and what heartbeats are apart.
  static constexpr Duration kFirstPatience = std::chrono::seconds(1);

  PublicKey who{};
  std::uint32_t current = 0;
  // Opens what was sealed before; and what a new handshake has led to, until it is used.
  std::uint32_t former = 0;
  std::uint32_t next = 0;
  // What a handshake before that has led to: the other side may use it until it has our answer to
  // the newest.
  std::uint32_t earlier = 0;
  // The list of revocations that it was last told of, and when.
  std::int64_t told_s = 0;
  TimePoint told_at{};
  // Who asks for sessions, where we connect to the peer, and when the next one is due.
  std::optional<Initiator> initiator;
  TimePoint rekey_at = TimePoint::max();
  // When a packet was last opened with the current session; nothing: none ever was.
  std::optional<TimePoint> heard_at;
  bool is_out_of_reach = false;
  // See kFirstPatience.
  TimePoint ask_after{};
  Duration patience = kFirstPatience;
};

}  // namespace interneuron::crypto
