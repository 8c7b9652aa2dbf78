// The origin's side of one pipeline (NOTES §1, §4.5): begins rounds, gives each exactly one outcome
// by t0 + D_N, and steers X by the outcomes. Pure; thread-compatible; bounded (rounds older than
// their deadline are always decided).
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "guard/observer.h"
#include "guard/x_controller.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

class Origin {
 public:
  // Throws std::invalid_argument when the configuration has no stage, too many, or a deadline or
  // period <= 0.
  Origin(PipelineConfig config, SessionId self);

  // What the header of a round carries.
  struct Begun {
    RoundRef ref;
    TimePoint t0{};
    XController::Sent sent;
  };
  Begun begin(TimePoint now);
  // The header's indicator for a message of `round` sent now.
  Indicator indicator(RoundId round) const;

  // A remote result is there. Nothing when it is late or the round is decided: it is dropped.
  std::optional<RoundDone> remote_result(TimePoint now, RoundId round, Bytes result, bool degraded);
  void local_result(RoundId round, Bytes result);
  // The policy decided that the round stays here: it is answered locally, and that is no miss.
  void stay_local(RoundId round);
  // Rounds whose deadline has passed at `now` (t0 + D_N <= now) are answered locally.
  std::vector<RoundDone> expire(TimePoint now);

  const Begun* open(RoundId round) const;
  std::optional<TimePoint> next_timeout() const;
  const PipelineConfig& config() const { return config_; }
  Observer& observer() { return observer_; }

 private:
  struct Open {
    Begun begun;
    std::optional<Bytes> local;
    bool stays_local = false;
  };
  struct Last {
    RoundId round{};
    Bytes result;
  };
  Open* find(RoundId round);
  RoundDone decide(TimePoint now, RoundId round, Outcome outcome);
  void keep_last(RoundId round, const Bytes& result);

  PipelineConfig config_;
  SessionId self_;
  XController x_;
  Observer observer_{true};
  std::uint32_t next_round_ = 0;
  std::deque<Open> open_;                                  // oldest first
  std::array<RoundState, ReferenceTime::kRing> states_{};  // by round % kRing
  std::optional<Last> last_;
};

}  // namespace interneuron::guard
