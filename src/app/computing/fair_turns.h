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
// Fed by RoadsideUnit with measured times. Bounds: one entry for each peer until forget(), which
// the owner calls when a peer is lost. Every call is O(log n). Times are durations; their sum stays
// in range for 292 years. Thread-compatible; pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::computing {

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

}  // namespace interneuron::computing
