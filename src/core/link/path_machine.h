// The state of one path as its traffic shows it (docs/links.md, "How a link is measured"): OK,
// SUSPECT, PULLED, LATCHED, DEAD, with hysteresis. Pure; thread-compatible; bounded memory;
// allocates only the reason of a change.
//
// Total silence stays PULLED until DEAD, where srtla_send would latch it. Latching it would keep a
// path out for two windows after each radio stall of a second; LATCHED is for a path that is heard
// while nothing of ours arrives. And each PULLED that ended by itself doubles the silence that the
// next one needs (up to 16 times, one step is forgiven every 60 s): a marginal path is not thrown
// out and taken back with every stall. SUSPECT keeps its threshold.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "interneuron/link.h"

namespace interneuron::link {

class PathMachine {
 public:
  // A path is dead after this silence, or after 3.5 heartbeats if that is longer. Other bonding
  // transports take 4 to 5 s (docs/constants.md, "States of a path").
  static constexpr Duration kDeadSilence = std::chrono::seconds(4);
  static constexpr Duration kRamp = std::chrono::seconds(1);
  static constexpr double kLeastShare = 0.1;
  static constexpr Duration kOutageWindow = std::chrono::seconds(60);

  // What it must know of the path to judge silence; refreshed with the estimates.
  struct Pace {
    Duration srtt{};  // zero while no round trip is known
    Duration rttvar{};
    Duration queue{};  // one-way queue signal, the larger of both directions
    // Between two signs of life of the peer when nothing else is sent. When it becomes shorter,
    // silence counts from then: the peer had promised no more.
    Duration heartbeat = std::chrono::milliseconds(300);
  };

  void set_pace(TimePoint now, const Pace& pace);
  // The last link must not be taken away: with `last_usable` the machine stays at kSuspect where
  // it would go to kPulled or kLatched.
  void set_last_usable(bool last) { last_usable_ = last; }

  // --- inputs, in the order of time
  void sent(TimePoint now, bool data);  // `data`: data-sized, its delivery would be proof
  void heard(TimePoint now);            // any packet of the peer on this path
  // The peer acknowledged packets sent on this path, the newest of them at `sent_at`; `data`: a
  // data-sized one is among them.
  void delivered(TimePoint now, TimePoint sent_at, bool data);
  void removed(TimePoint now);  // the NIC or the path is gone; hearing it again revives it
  void handle_timeout(TimePoint now);

  // --- outputs
  PathState state() const { return state_; }
  bool usable() const { return state_ == PathState::kOk || state_ == PathState::kSuspect; }
  // Rises from 0.1 to 1 in the second after a path came back from kLatched or kDead.
  double share(TimePoint now) const;
  struct Change {
    PathState from{};
    PathState to{};
    std::string reason;
  };
  // Changes in their order; no more than the last four are kept.
  std::optional<Change> poll_change();
  std::optional<TimePoint> next_timeout() const;
  // Share of the last 60 s, or of the life since it was first heard, in which the path was not
  // usable.
  double outage(TimePoint now) const;

 private:
  // Instants at which data left, at least kGroup apart, that no acknowledgement covers yet.
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

  bool knows_round_trip() const { return pace_.srtt > Duration::zero(); }
  Duration suspect_after() const;
  Duration pulled_after() const;
  Duration idle_suspect_after() const;
  Duration idle_pulled_after() const;
  Duration dead_after() const;
  Duration proof_window() const;
  TimePoint silent_since() const;
  TimePoint suspect_at() const;
  TimePoint pulled_at() const;
  std::optional<TimePoint> latched_at() const;
  TimePoint dead_at() const;
  void take_back(TimePoint now, Duration silence);
  void forget_load();
  void reconsider(TimePoint now);
  std::string silence_text(TimePoint now) const;
  void change(TimePoint now, PathState to, std::string reason);
  void count_outage(TimePoint now);

  Pace pace_{};
  PathState state_ = PathState::kDead;
  TimePoint changed_at_{};
  bool last_usable_ = false;
  bool long_queue_ = false;
  std::optional<TimePoint> heard_at_;
  TimePoint quickened_at_ = TimePoint::min();  // heartbeats come more often from then on
  TimePoint acknowledged_at_ = TimePoint::min() + std::chrono::hours(1);  // sums stay in range
  Waiting waiting_;
  // Data sent since the last proof of delivery.
  std::uint32_t unproven_ = 0;
  TimePoint unproven_since_{};
  TimePoint unproven_newest_{};
  // In kLatched: since when proof has come without a gap.
  std::optional<TimePoint> proof_since_;
  TimePoint proof_at_{};
  std::optional<TimePoint> ramp_from_;
  // How often silence was judged too early, and when that last changed.
  int patience_ = 0;
  TimePoint patience_at_{};
  std::array<Change, 4> changes_{};
  std::size_t changes_first_ = 0;
  std::size_t changes_count_ = 0;
  std::array<OutageSecond, 61> outage_{};
  std::optional<TimePoint> born_at_;  // first heard
  TimePoint counted_to_{};
};

}  // namespace interneuron::link
