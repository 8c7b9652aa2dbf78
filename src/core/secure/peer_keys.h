// What Sessions keeps of each session, and of each peer. Plain values; beside them what it knows of
// the time of day and of keys that two hosts use.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/secure/handshake.h"
#include "core/secure/session.h"
#include "interneuron/security.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

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
  // Renewals for want of paths, or because a key has sealed much, are at least this far apart.
  static constexpr Duration kBetweenRekeys = std::chrono::seconds(1);

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

  // The current session was used.
  void renew_if_worn(const Session& session) {
    if (!session.wants_rekey() || !initiator) return;
    rekey_at = std::min(rekey_at, session.born() + kBetweenRekeys);
  }
  // A packet was opened with the current session.
  void heard(TimePoint now, const Session& session) {
    heard_at = now;
    renew_if_worn(session);
  }
};

// The time of day, ns since 1970, as far as a host knows it: what was said at the beginning or by a
// host that we connected to, and never less than what was said here, so that handshakes say times
// that only grow. A host that is believed may say any time; none above kLatestBelievedNs counts.
// Pure; thread-compatible.
class TimeOfDay {
 public:
  // The latest time that is believed, which is in the year 2097: who says a later one cannot keep a
  // host that believed it from being heard before kLatestUnixNs.
  static constexpr std::int64_t kLatestBelievedNs = kLatestUnixNs - (std::int64_t{1} << 59U);

  TimeOfDay(TimePoint now, std::int64_t unix_ns) : started_(now), at_start_ns_(unix_ns) {}

  // Keep it for the next start.
  std::int64_t unix_ns(TimePoint now) const { return std::max(said_ns_, reckoned_ns(now)); }
  // The host's clock says so. Counts where it is later.
  void raise_unix_ns(TimePoint now, std::int64_t unix_ns) {
    const std::int64_t behind = std::min(unix_ns, kLatestBelievedNs) - reckoned_ns(now);
    if (behind > 0) at_start_ns_ += behind;
  }
  // What is said next: it grows with every call, also where the clock does not.
  std::int64_t next_unix_ns(TimePoint now) {
    said_ns_ = std::max(said_ns_ + 1, unix_ns(now));
    return said_ns_;
  }

 private:
  std::int64_t reckoned_ns(TimePoint now) const {
    return at_start_ns_ + Duration(now - started_).count();
  }

  TimePoint started_;
  std::int64_t at_start_ns_;
  std::int64_t said_ns_ = 0;
};

// Which keys two hosts use: a life that was followed by another one does not come back by itself,
// so that a second host has the key where it does. Told of every life that is adopted; bounded by
// kMaxKeysWithLives keys of kMaxLives each. Pure; thread-compatible.
class SharedKeys {
 public:
  // Lives of one key that are remembered, and keys of which they are.
  static constexpr std::size_t kMaxLives = 8;
  static constexpr std::size_t kMaxKeysWithLives = 1024;
  // A key is told of again after so long at the earliest.
  static constexpr Duration kBetweenSharedKeys = std::chrono::minutes(1);

  void note_life(TimePoint now, const PublicKey& who, SessionId life) {
    if (!lives_.contains(who) && lives_.size() >= kMaxKeysWithLives) lives_.erase(lives_.begin());
    Lives& lives = lives_[who];
    if (!lives.known.empty() && lives.known.back() == life) return;
    const bool is_back = std::erase(lives.known, life) > 0;
    lives.known.push_back(life);
    if (lives.known.size() > kMaxLives) lives.known.erase(lives.known.begin());
    const bool is_told =
        lives.told_at != TimePoint::min() && now - lives.told_at < kBetweenSharedKeys;
    if (!is_back || is_told) return;
    lives.told_at = now;
    shared_.push_back(who);
  }
  // A key that two hosts use; ask until nothing comes.
  std::optional<PublicKey> poll() {
    if (shared_.empty()) return std::nullopt;
    const PublicKey key = shared_.front();
    shared_.pop_front();
    return key;
  }

 private:
  // The lives that a key has had lately, newest last.
  struct Lives {
    std::vector<SessionId> known;
    TimePoint told_at = TimePoint::min();
  };
  std::map<PublicKey, Lives> lives_;
  std::deque<PublicKey> shared_;
};

}  // namespace interneuron::crypto
