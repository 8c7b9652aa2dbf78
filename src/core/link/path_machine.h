// The state of one path as its traffic shows it: OK, SUSPECT, PULLED, LATCHED, DEAD, with
// hysteresis (docs/links.md, "How a link is measured", has the whole rule).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/link.h"

namespace interneuron::link {

// Judges one path to one peer by what is sent on it, heard on it and acknowledged. LinkEstimator
// feeds it and asks it whether messages may use the path.
//
// A path that is silent while data is in flight becomes PULLED and stays so until it is heard again
// or DEAD. (srtla_send latches it at once, which would keep a path out for two proof windows after
// each radio stall of a second.) LATCHED is for a path that is heard while nothing of ours arrives.
// Each PULLED that ended by itself within a second doubles the silence that the next one needs, up
// to 16 times, and one doubling is taken back every 60 s, so that a marginal path is not thrown out
// and taken back with every stall. SUSPECT keeps its threshold.
//
// A peer that lies about acknowledgements can keep a path in use or out of use, but only its own
// paths; times from its clock are not used. Pure; thread-compatible; constant memory (1 KB, and
// another one once there was an outage); allocates that and the reason of a change.
class PathMachine {
 public:
  // A path is dead after this silence, or after 3.5 heartbeats if that is longer. Other bonding
  // transports take 4 to 5 s (docs/constants.md, "States of a path").
  static constexpr Duration kDeadSilence = std::chrono::seconds(4);
  // A path that came back from kLatched or kDead gets kLeastShare of its traffic at once, and all
  // of it after kRamp.
  static constexpr Duration kRamp = std::chrono::seconds(1);
  static constexpr double kLeastShare = 0.1;
  // Outages older than this are forgotten.
  static constexpr Duration kOutageWindow = std::chrono::seconds(60);

  // What the machine must know of the path to judge silence; refreshed with the estimates.
  struct Pace {
    // The smoothed round trip (zero while none is known) and its variation.
    Duration srtt{};
    Duration rttvar{};
    // How long packets wait in queues, in the direction where they wait longer.
    Duration queue{};
    // Between two signs of life of the peer when nothing else is sent. When it becomes shorter,
    // silence counts from then on, because the peer had promised no more before.
    Duration heartbeat = std::chrono::milliseconds(300);
    // For how long the peer may hold back its feedback beyond the usual.
    Duration feedback{};
    friend bool operator==(const Pace&, const Pace&) = default;
  };

  PathMachine();

  void set_pace(TimePoint now, const Pace& pace);
  // The last link must not be taken away: with `last_usable` the machine stays at kSuspect where
  // it would go to kPulled or kLatched.
  void set_last_usable(bool last) { last_usable_ = last; }

  // --- inputs, in the order of time
  // A packet left on this path; `data` when it is so large that its delivery is proof that the path
  // carries messages.
  void sent(TimePoint now, bool data);
  // Any packet of the peer came in on this path.
  void heard(TimePoint now);
  // The peer acknowledged packets sent on this path, the newest of which left at `sent_at`; `data`
  // when a data-sized one is among them.
  void delivered(TimePoint now, TimePoint sent_at, bool data);
  // The NIC or the path is gone; hearing it again revives it.
  void removed(TimePoint now);
  void handle_timeout(TimePoint now);

  // --- outputs
  PathState state() const { return state_; }
  bool usable() const { return state_ == PathState::kOk || state_ == PathState::kSuspect; }
  // The share of its usual traffic that the path gets, in [0, 1]: 0 while it is not usable, and
  // rising from kLeastShare to 1 while it ramps up.
  double share(TimePoint now) const;
  struct Change {
    PathState from{};
    PathState to{};
    std::string reason;
  };
  // The changes since the last call, oldest first; no more than the newest four are kept.
  std::optional<Change> poll_change();
  std::optional<TimePoint> next_timeout() const;
  // Share of kOutageWindow, or of the time since the path was first heard, in which it was not
  // usable.
  double outage(TimePoint now) const;

 private:
  // The instants at which data left that no acknowledgement covers yet, oldest first and at least
  // kGroup apart. Of more than kSize the oldest are forgotten.
  class Waiting {
   public:
    void sent(TimePoint at);
    void covered(TimePoint sent_at);
    bool any() const { return count_ > 0; }
    TimePoint since() const { return at_[first_]; }

   private:
    static constexpr std::size_t kSize = 64;
    std::array<TimePoint, kSize> at_{};
    std::size_t first_ = 0;
    std::size_t count_ = 0;
  };
  struct OutageSecond {
    std::int64_t second = INT64_MIN;
    Duration out{};
  };
  static constexpr std::size_t kOutageSeconds = 61;

  bool knows_round_trip() const { return pace_.srtt > Duration::zero(); }
  void set_thresholds();
  void set_patience(TimePoint now, int patience);
  TimePoint silent_since() const;
  TimePoint suspect_at() const;
  TimePoint pulled_at() const;
  std::optional<TimePoint> latched_at() const;
  TimePoint dead_at() const;
  void take_back(TimePoint now, Duration silence);
  void all_proven();
  void forget_load();
  void reconsider(TimePoint now);
  std::string silence_text(TimePoint now) const;
  void change(TimePoint now, PathState to, std::string reason);
  void count_outage(TimePoint now);

  Pace pace_{};
  // After how long something follows, by pace_ and patience_: from silence while data is in flight,
  // from silence without data, and from silence in the end; and how long delivery is to be proved.
  struct After {
    Duration suspect{};
    Duration pulled{};
    Duration idle_suspect{};
    Duration idle_pulled{};
    Duration dead{};
    Duration proof{};
  };
  After after_{};
  PathState state_ = PathState::kDead;
  TimePoint changed_at_{};
  bool last_usable_ = false;
  bool long_queue_ = false;
  std::optional<TimePoint> heard_at_;
  // Heartbeats come more often from then on.
  TimePoint quickened_at_ = TimePoint::min();
  // Long ago; an hour after the first instant there is, so that differences stay in range.
  TimePoint acknowledged_at_ = TimePoint::min() + std::chrono::hours(1);
  Waiting waiting_;
  // Data packets sent since the last proof of delivery, the first of them, and the one with which
  // they were enough, for long enough, to doubt the path.
  std::uint32_t unproven_ = 0;
  TimePoint unproven_since_{};
  std::optional<TimePoint> unproven_enough_at_;
  // In kLatched: since when data was acknowledged without a gap, and when last.
  std::optional<TimePoint> proof_since_;
  TimePoint proof_at_{};
  std::optional<TimePoint> ramp_from_;
  // How often the silence that pulls the path was doubled, and when that last changed.
  int patience_ = 0;
  TimePoint patience_at_{};
  std::array<Change, 4> changes_{};
  std::size_t changes_first_ = 0;
  std::size_t changes_count_ = 0;
  // A ring of the seconds of kOutageWindow and the one that is not over; empty before the first
  // outage.
  std::vector<OutageSecond> outage_;
  // When the path was first heard.
  std::optional<TimePoint> born_at_;
  // Outages up to this instant are in the ring.
  TimePoint counted_to_{};
};

}  // namespace interneuron::link
