// The observer of a pipeline's stages at one node (NOTES §4.1-4.4): records θn, derives Dn and
// judges. One per (origin session, pipeline): state is never shared between vehicles. Pure;
// thread-compatible; bounded.
#pragma once

#include <cstdint>
#include <optional>

#include "guard/clock_offset.h"
#include "guard/reference_time.h"
#include "interneuron/guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

// A round at the end of stage `stage`, as its header tells.
struct StageEnd {
  RoundId round{};
  std::size_t stage = 1;
  PeerTime t0{};
  std::int16_t x_permille = 0;
  Duration deadline{};  // D_N
};

class Observer {
 public:
  // `at_origin`: this node stamped t0, so α = 0 and the configured D_N bounds the last stage.
  explicit Observer(bool at_origin = false) : at_origin_(at_origin) {}

  void learn(TimePoint now, RoundId current, const Indicator& indicator) {
    times_.learn(now, current, indicator);
  }
  void settle(TimePoint now, RoundId round, RoundState state) { times_.settle(now, round, state); }
  std::optional<Duration> base(TimePoint now, std::size_t stage) { return times_.base(now, stage); }

  // Stage deadline D_n as θ (it contains the offset, like θ): base_n + X·b_n. Nothing without base
  // or clock.
  std::optional<Duration> stage_deadline(TimePoint now, const StageEnd& end,
                                         const std::optional<ClockView>& clock);

  // The stage ends now: records θn and judges it.
  Verdict end_stage(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock);

  // Until when a smaller variant that arrived now may be held for a better one; at or before `now`
  // = not at all.
  struct Hold {
    TimePoint until{};
    bool is_stage_deadline = false;  // false: a bound ended the hold before D_n, or there is no D_n
    bool has_reference = false;      // there is a D_n
  };
  Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
            bool last_stage);
  // A held variant is handed over by the timer: θn is exactly the instant of release, and timer
  // lateness never counts.
  Verdict end_stage_held(const StageEnd& end, const Hold& hold);

  // A clock stepped or the session is new: nothing learnt before holds.
  void reset() { times_.reset(); }

 private:
  bool at_origin_;
  ReferenceTime times_;
};

}  // namespace interneuron::guard
