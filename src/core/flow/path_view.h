// What the sender is told of a path, what congestion control is told of the sender's use of it, and
// what the path teaches of predictions. Pure; thread-compatible; constant memory.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "core/code/redundancy.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Stands for a time beyond any that is planned with, so that sums of times stay in range.
inline constexpr Duration kNever = std::chrono::hours(1);

// The rate before anything is known of a path, which a start-up train measures within a round
// trip: that of a weak 4G uplink. The pace has the same headroom as that of a known rate,
// RateEstimator::kHeadroom.
inline constexpr DataRate kBlindRate{20'000'000};
inline constexpr DataRate kBlindPace{25'000'000};

// What the sender must know of a path; refreshed by set_path() whenever the estimates move.
struct PathView {
  // While it is false nothing is sent on the path.
  bool up = true;
  // It may have fallen silent: see Sender::doubt().
  bool suspect = false;
  // Retransmissions prefer the other paths.
  bool backup = false;
  // The rate that the path delivers, to plan with, and the pace at which packets leave. While they
  // are not known, kBlindRate and kBlindPace stand in.
  std::optional<DataRate> rate;
  std::optional<DataRate> pace;
  // What the path may carry soon: what cannot arrive even so is given up.
  std::optional<DataRate> soon;
  // The highest rate that was believed of the path lately, and when it was last measured.
  std::optional<DataRate> best;
  TimePoint best_at{};
  // The expected one-way delay, and the least one of late; zero while they are not known.
  Duration one_way{};
  Duration least_one_way{};
  // How much the delay varies: RTTVAR of RFC 6298.
  Duration jitter{};
  // Bytes that may be in flight, with IP headers.
  std::size_t window = SIZE_MAX;
  // The path carries all it can: what is in flight beyond an empty path waits in a queue.
  bool loaded = false;
  // Others use the path as well: what our share does not bring now is not to be hoped for.
  bool crowded = false;
  // A queue on the way marks what waits for a millisecond: long batches would be marked.
  bool short_queue = false;
  // All of it, and not our share alone, is little (src/core/base/slow_link.h).
  bool slow = false;
  // What is data-sized leaves with ECT.
  bool ect = false;
  // A fragment that has been in flight for so long without any acknowledgement is lost.
  Duration probe_timeout{};
  // For how long the peer may hold back its reports beyond the usual, because its way back is slow.
  // The timeout above contains it.
  Duration report_spacing{};
  // What is expected of losses.
  code::Losses losses{};

  DataRate planned_rate() const { return rate.value_or(kBlindRate); }
  // How long so many bytes take to leave at the rate that is planned with.
  Duration air_time(std::size_t bytes) const {
    return std::min<Duration>(planned_rate().transmit_time(bytes), kNever);
  }
};

// How a path was used since congestion control was last told: whether something had to wait, and
// for how long something was queued. Owned and fed by the Sender, one per path.
class PathUse {
 public:
  // What congestion control is told (cc::ShareControl::Report).
  struct Told {
    // Something had to wait for the pace or the window.
    bool held_back = false;
    // For how long something was queued.
    Duration backlog{};
    // Packets found lost by silence.
    std::uint32_t lost = 0;
    // The rate at which the newest message is sent within kOwnPart of its time.
    DataRate needed{};
  };

  // A message of so many bytes is queued, which is to arrive within `left`.
  void message(TimePoint now, std::size_t bytes, Duration left) {
    told_.needed = rate_of(kOwnPart * bytes, left);
    queued(now);
  }
  // Something is queued.
  void queued(TimePoint now) {
    if (!queued_) since_ = now;
    queued_ = true;
  }
  // Nothing is queued any more.
  void emptied(TimePoint now) {
    if (queued_) told_.backlog += now - since_;
    queued_ = false;
  }
  // So many packets are lost that no report has told of.
  void lost(std::uint32_t packets) { told_.lost += packets; }
  // Something is queued that may not leave yet.
  void held_back() { told_.held_back = true; }

  DataRate needed() const { return told_.needed; }
  Told take(TimePoint now) {
    if (queued_) {
      told_.backlog += now - since_;
      since_ = now;
    }
    return std::exchange(told_, Told{.needed = told_.needed});
  }

 private:
  // The part of a message's time that may pass until it has left: a third of it, and the rest is
  // for the way and for queues. No measurement behind this value.
  static constexpr std::size_t kOwnPart = 3;

  Told told_;
  bool queued_ = false;
  TimePoint since_{};
};

// How far off a path is when it is said when it will have brought something. Owned by the Sender,
// one per path, which tells it of every message or share of one that the path has brought, or has
// not when its time was over. It learns by which part of the time on the air predictions were too
// short, and how much that varies: a path whose rate is steady is off by a few hundredths, one of a
// moving modem by as much as the time itself. What the peer reports decides it, which harms what is
// sent to that peer alone.
class CompletionLaw {
 public:
  // What took `air` on the air by what was believed was there so much later than predicted.
  void learn(Duration late, Duration air) {
    if (air < kLeastAir) return;
    const double ratio = std::clamp(to_seconds(late) / to_seconds(air), kLeastRatio, kMostRatio);
    const double off = ratio - mean_;
    mean_ += kGain * off;
    variance_ = (1 - kGain) * (variance_ + kGain * off * off);
  }
  // By which part the air time is too short in the mean, and the standard deviation of that.
  double mean() const { return mean_; }
  double deviation() const { return std::sqrt(variance_); }

 private:
  // The gain of means of round trips (RFC 6298).
  static constexpr double kGain = 1.0 / 8;
  // What is shorter than this says more of the turns of event loops.
  static constexpr Duration kLeastAir = std::chrono::milliseconds(4);
  // Nothing takes less than no time, and a stall is not the path's rate.
  static constexpr double kLeastRatio = -0.9;
  static constexpr double kMostRatio = 4;

  double mean_ = 0;
  // Rates are believed to within 20 % (docs/links.md, "How a link is measured"): two deviations.
  double variance_ = 0.01;
};

}  // namespace interneuron::flow
