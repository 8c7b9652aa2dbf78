// The computations of a roadside unit: inputs of many vehicles wait for one worker, in the order in
// which they were handed over.
//
// A driver (the program `road` on a Node, the simulation in sim::World) calls add() when an input
// may be computed, and after that and after each end() asks next(). If that names a job, the driver
// determines its level, by the guard of the job's round or by a rule of its own, calls begin() and
// gives the job to its worker; when the worker is done it calls end() and submits the result. The
// level is determined only when the worker takes the job, because the time that the job has waited
// is lost for the computation.
//
// Each job ends exactly once: refused by add(), dropped by next(), or computed. A job is dropped
// when more than its round's deadline has passed since the hand-over, since the vehicle has then
// answered the round itself. At most one job is computed at a time, so a detector needs no lock.
//
// Bounds and attacks: deadlines and inputs come from peers. A peer that claims an endless deadline
// fills the line up to kMaxWaiting and no further; the jobs of others are then refused too, since
// the line is shared, until the worker has caught up.
//
// `Input` is what the driver's worker needs; it is moved, never looked at. Thread-compatible; pure.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/offload/level_times.h"
#include "interneuron/round.h"

namespace interneuron::offload {

// One computation that has begun. Instants are of the unit's host.
struct Computed {
  RoundRef round;
  PeerId from{};
  std::uint8_t variant = 0;
  std::size_t level = 0;
  // The input was sent degraded.
  bool degraded = false;
  TimePoint delivered{};
  TimePoint began{};
  // Set when the computation has ended.
  TimePoint ended{};
};

template <class Input>
class RoadsideUnit {
 public:
  // Three times what 16 vehicles can have waiting at 10 rounds per second and a deadline of 130 ms.
  static constexpr std::size_t kMaxWaiting = 64;

  struct Job {
    // What was handed over. Its payload is not used here and may be empty.
    Delivered message;
    TimePoint delivered{};
    // The level that the guard steps down from.
    std::size_t top = 0;
    Input input;
  };

  // `levels` is not empty. With a `top_level`, no level above it is ever offered; one beyond the
  // last means the last.
  explicit RoadsideUnit(std::vector<LevelProfile> levels,
                        std::optional<std::size_t> top_level = std::nullopt)
      : times_(std::move(levels)), top_level_(top_level) {
    if (top_level_) top_level_ = std::min(*top_level_, times_.levels().size() - 1);
  }

  // The levels that begin() takes: all, or those up to the given top level.
  std::span<const LevelProfile> levels() const {
    return top_level_ ? times_.levels().first(*top_level_ + 1) : times_.levels();
  }
  // The level for a vehicle that can afford `budget` for the computation: the given top level, else
  // the highest that is quick enough here.
  std::size_t top_level(Duration budget) const {
    return top_level_ ? *top_level_ : times_.highest_within(budget);
  }

  // The job waits from now on. False when the line is full; the job has then ended.
  bool add(Job job) {
    if (waiting_.size() >= kMaxWaiting) {
      ++dropped_;
      return false;
    }
    waiting_.push_back(std::move(job));
    return true;
  }

  // Drops the jobs that nobody waits for any more. Then the oldest that is left, valid until the
  // next call; nullptr while the worker is busy or nothing waits.
  const Job* next(TimePoint now) {
    dropped_ += std::erase_if(
        waiting_, [now](const Job& job) { return now - job.delivered > job.message.deadline; });
    return running_ || waiting_.empty() ? nullptr : &waiting_.front();
  }

  // The worker takes the job that next() has just named, to compute it at this level.
  Job begin(TimePoint now, std::size_t level) {
    assert(!running_ && !waiting_.empty() && level < levels().size());
    Job job = std::move(waiting_.front());
    waiting_.pop_front();
    const Delivered& message = job.message;
    running_ = Computed{message.round,
                        message.from,
                        message.variant,
                        level,
                        message.degraded,
                        job.delivered,
                        now,
                        {}};
    return job;
  }

  // The worker is done and free. `took` is the run time to be learnt for the level; nothing if the
  // levels' times are known and stay.
  Computed end(TimePoint now, std::optional<Duration> took = std::nullopt) {
    assert(running_);
    Computed computed = *std::exchange(running_, std::nullopt);
    computed.ended = now;
    if (took) times_.learn(computed.level, *took);
    ++computed_;
    return computed;
  }

  bool busy() const { return running_.has_value(); }
  std::size_t waiting() const { return waiting_.size(); }
  std::uint64_t computed() const { return computed_; }
  // Jobs that were refused by add() or dropped by next().
  std::uint64_t dropped() const { return dropped_; }

 private:
  LevelTimes times_;
  std::optional<std::size_t> top_level_;
  std::deque<Job> waiting_;
  std::optional<Computed> running_;
  std::uint64_t computed_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace interneuron::offload
