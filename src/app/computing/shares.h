// How the time of one worker is divided between the peers that want it: whose turn it is
// (FairTurns), and how long one job may take (ShareOfTime). Both are fed by RoadsideUnit.
// Thread-compatible; pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::computing {

// Whose turn it is at one worker that several peers want, so that each gets an equal part of its
// time: start-time fair queueing (Goyal, Vin and Cheng, "Start-time Fair Queuing") by the time that
// jobs took. Nobody has to say beforehand how long a job takes, which a peer could lie about.
//
// Each peer has an account of the time that it was served. The peer with the smallest account is
// next, among equals the one that has wanted longest. Who begins to want after a pause starts at
// the account of the peer that was served last, so that nobody saves up a claim by being idle, and
// who took less than its part waits for the job that runs and for others alike alone.
//
// What it promises: a peer that wants all the time, owes nothing at first and shares the worker
// with at most n - 1 others gets at least the n-th part of the time that the worker serves, less
// one job of the longest kind. If it owed something, that is at most one job of its own, and it
// waits for that too. A peer that comes back under another identity owes nothing again: it gains
// one job by it at most.
//
// Fed with measured times. Bounds: one entry for each peer until forget(), which
// the owner calls when a peer is lost. Every call is O(log n). Times are durations; their sum stays
// in range for 292 years.
class FairTurns {
 public:
  // The peer has something to do. Nothing changes when it wants already.
  void want(PeerId peer);
  // It has nothing to do any more.
  void rest(PeerId peer);
  // It is gone: what it owed is forgotten.
  void forget(PeerId peer);

  // Whose turn it is; nothing when nobody wants.
  std::optional<PeerId> next() const;
  // The peer's job begins. It wants on until rest().
  void begin(PeerId peer);
  // The peer was served for so long; a negative time counts as none. Ignored for a peer that was
  // forgotten meanwhile.
  void charge(PeerId peer, Duration took);

  // Peers that want.
  std::size_t wanting() const { return order_.size(); }

 private:
  struct Account {
    Duration served{};
    // Since when it wants, in calls of want(); 0 while it does not.
    std::uint64_t since = 0;
  };
  using Place = std::tuple<Duration, std::uint64_t, PeerId>;

  static Place place(PeerId peer, const Account& account) {
    return {account.served, account.since, peer};
  }

  std::map<PeerId, Account> accounts_;
  // Those that want, who is next first.
  std::set<Place> order_;
  // The account of the newest job's peer when that job began.
  Duration reached_{};
  std::uint64_t calls_ = 0;
};

// How long one job of a peer may take where several peers share one worker: its part of the time
// that passes between two jobs of its own. A vehicle that sends ten images a second beside one
// other gets 50 ms for each, one that sends a hundred 5 ms: whoever sends more often gets lighter
// levels, and all together never ask for more time than there is. FairTurns alone would give each
// its part too, but a job that has begun is not interrupted: the others would wait for one that
// takes as long as the sender likes.
//
// A peer counts while it has sent something within the last kActive. A peer alone may take any
// time, and so may one whose interval is not known yet. The interval is smoothed, since what
// arrives over a radio link comes in bursts. A part that somebody leaves unused is not given to
// others: whoever counts on it would have it taken away with the next image.
//
// Bounds: one entry for each peer until forget(). What an attacker can do is
// to count as one peer, as an honest one does. Calls are O(log n), amortised.
class ShareOfTime {
 public:
  // Ten periods of a camera at 10 Hz: who skips a few images keeps its place. No measurement behind
  // it.
  static constexpr Duration kActive = std::chrono::seconds(1);
  // The weight of the newest interval, so that about the last eight count, as for round-trip times
  // (RFC 6298).
  static constexpr int kSmoothing = 8;

  // A job of the peer came, whether it is computed or not.
  void came(PeerId peer, TimePoint now);
  void forget(PeerId peer);

  // The longest that one job of the peer may take now.
  Duration longest(PeerId peer, TimePoint now);
  // The peers that count now.
  std::size_t active(TimePoint now);

 private:
  struct Arrivals {
    TimePoint last{};
    std::optional<Duration> interval;
  };

  std::map<PeerId, Arrivals> peers_;
  // Those that count, who was silent longest first.
  std::set<std::pair<TimePoint, PeerId>> active_;
};

}  // namespace interneuron::computing
