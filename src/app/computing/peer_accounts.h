// What a RoadsideUnit knows of its peers beside the jobs that wait, and how long the levels of a
// computation take. Thread-compatible; pure.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "app/computing/jobs.h"
#include "app/computing/shares.h"
#include "core/base/ring.h"
#include "interneuron/guard.h"

namespace interneuron::computing {

// How long the levels of a computation take on this host: as they were calibrated, or as the newest
// runs in operation took if those were slower, since in operation other programs share the
// processor. The levels are ordered from the lowest quality to the highest; quality and median stay
// as given, the 95th percentile is learnt.
//
// Keeps at most kRemembered run times per level, so its memory is bounded by the number of levels.
// Fed by RoadsideUnit with run times measured on this host, one LevelTimes for each peer: how long
// a level takes depends on the image too, and nobody's images may make another's levels look slow.
class LevelTimes {
 public:
  // The newest run times of a level that its 95th percentile is computed from: 4 s at 10 rounds per
  // second, and enough that the slowest single run is not the percentile.
  static constexpr std::size_t kRemembered = 40;
  // With fewer run times than this the calibration alone counts.
  static constexpr std::size_t kFewest = 3;

  // `levels` is not empty.
  explicit LevelTimes(std::vector<LevelProfile> levels);

  std::span<const LevelProfile> levels() const { return levels_; }
  // A run at `level` took so long; level < levels().size().
  void learn(std::size_t level, Duration took);
  // The larger of the calibrated 95th percentile and that of the remembered runs.
  Duration p95(std::size_t level) const;
  // The least that a computation takes: the median of the lowest level, or the quickest of its
  // remembered runs if that was quicker.
  Duration least() const;
  // The highest level whose 95th percentile is at most `time`; level 0 if none is that quick.
  std::size_t highest_within(Duration time) const;

 private:
  std::vector<LevelProfile> levels_;
  std::vector<Ring<Duration>> runs_;
};

// What a RoadsideUnit knows of its peers beside the jobs that wait: how long the levels take on
// their images, whose turn it is, how long one job of theirs may take, what became of their jobs.
//
// Run times are kept for each peer by itself, because they depend on what is in an image: nobody's
// images may make the levels look slow to others. Time is charged to whoever's job it was, whatever
// came of it.
//
// Fed by RoadsideUnit. Bounds: one entry for each peer until forget(). At most one job is computed
// at a time.
class PeerAccounts {
 public:
  // As RoadsideUnit's.
  PeerAccounts(std::vector<LevelProfile> levels, std::optional<std::size_t> top_level);

  std::span<const LevelProfile> levels() const;
  std::span<const LevelProfile> levels(PeerId peer, TimePoint now);
  std::size_t top_level(PeerId peer, Duration budget) const;
  // The least that a job of the peer takes.
  Duration least(PeerId peer) const { return times(peer).least(); }

  // The peer has sent something: it has an account from now on.
  void know(PeerId peer);
  // A job of the peer came.
  void came(PeerId peer, TimePoint now);
  // Whether jobs of the peer wait.
  void waits(PeerId peer, bool any);
  // Whose job is next; nothing when none waits.
  std::optional<PeerId> turn() const { return turns_.next(); }

  // The worker has begun a job, and is free again.
  void begin(const Computed& job);
  bool busy() const { return running_.has_value(); }
  // `took` is what the level's run took, to be learnt; nothing to learn nothing.
  Computed end(TimePoint now, std::optional<Duration> took);
  void fail(TimePoint now);

  // A job has ended without a result. Nobody is told when its peer is gone.
  void tell(const Unanswered& job);
  std::optional<Unanswered> poll_unanswered();
  void forget(PeerId peer);

  const PeerWork& total() const { return total_; }
  PeerWork work(PeerId peer) const;

 private:
  struct Account {
    LevelTimes times;
    PeerWork work;
  };

  Account* find(PeerId peer);
  const LevelTimes& times(PeerId peer) const;
  Computed finish(TimePoint now);

  // The run times of a peer of which nothing is known; its levels are those of the unit.
  LevelTimes unknown_;
  std::optional<std::size_t> top_level_;
  std::map<PeerId, Account> accounts_;
  FairTurns turns_;
  ShareOfTime share_;
  std::optional<Computed> running_;
  std::deque<Unanswered> unanswered_;
  PeerWork total_;
};

}  // namespace interneuron::computing
