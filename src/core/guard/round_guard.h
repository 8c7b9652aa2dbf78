// The guard's side of the origin: what a round sets out with, and what its outcome teaches. One
// rule per GuardKind behind one interface; one instance per pipeline. Pure; thread-compatible;
// bounded.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "core/guard/stage_guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

// What a mode of the first transmission promises: per variant, when its answer would be there if
// its computation took no time, from the instant of the forecast on. Nothing: the plan does not
// hold it, or nothing is known.
using Forecast = std::array<std::optional<Duration>, kMaxVariants>;

// What the header of a result says of its round.
struct Spent {
  std::optional<std::uint8_t> level;    // computed last
  std::optional<std::uint8_t> variant;  // of the input
  std::optional<Duration> excess;       // see LevelChoice
  std::optional<Duration> computed;     // all computations
};

class RoundGuard {
 public:
  virtual ~RoundGuard() = default;

  struct Sent {
    std::int16_t x_permille = 0;
    bool recovering = false;
    bool degraded = false;  // the first transmission is sacrificed
  };
  // A round begins; base_n: the reference of the whole pipeline, if there is one.
  virtual Sent begin(std::optional<Duration> base_n, Duration deadline) = 0;

  // Whether choose_degraded() weighs forecasts: else it need not be given any.
  virtual bool weighs() const { return false; }
  // The mode of the first transmission, `since` after t0.
  virtual bool choose_degraded(TimePoint, RoundId, const Sent& sent, Duration /*since*/,
                               const Forecast& /*normal*/, const Forecast& /*degraded*/) {
    return sent.degraded;
  }

  // A result came, on time or not.
  virtual void result(TimePoint, RoundId, Duration /*e2e*/, const Spent&) {}
  // The round was decided.
  virtual void on_time(const Sent& sent) = 0;
  virtual void missed(TimePoint now, RoundId round) = 0;
};

std::unique_ptr<RoundGuard> make_round_guard(const PipelineConfig& config);

}  // namespace interneuron::guard
