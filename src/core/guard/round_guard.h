// The guard at the origin: what a round sets out with, and what its outcome teaches. RoundGuard is
// the interface that RoundLedger uses; PaperOrigin and BudgetOrigin are the two rules behind it,
// one per GuardKind. There is one instance per pipeline, owned by its ledger. Pure;
// thread-compatible; bounded.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/base/ablation.h"
#include "core/guard/stage_guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

// What a mode of the first transmission promises: per variant, how long from the instant of the
// forecast until its answer would be back if the computation took no time. Nothing for variants
// that the plan does not hold or of which nothing is known.
using Forecast = std::array<std::optional<Duration>, kMaxVariants>;

// What the header of a result says of its round. A peer wrote it; nothing where it was not told.
struct Spent {
  // The level of the last computation.
  std::optional<std::uint8_t> level;
  // The variant of the input that was computed on.
  std::optional<std::uint8_t> variant;
  // How much later than usual the computation began (LevelChoice::excess, stage_guard.h). No guard
  // decides by it; the dissector shows it.
  std::optional<Duration> excess;
  // How long all computations of the round took together.
  std::optional<Duration> computed;
};

class RoundGuard {
 public:
  virtual ~RoundGuard() = default;

  // What a round sets out with.
  struct Sent {
    // The tolerance X in 1/1000.
    std::int16_t x_permille = 0;
    // A round was missed lately, and X has not recovered from it.
    bool recovering = false;
    // The first transmission is sacrificed.
    bool degraded = false;
  };
  // A round begins. `base_n`: the reference time of the whole pipeline, if there is one.
  virtual Sent begin(std::optional<Duration> base_n, Duration deadline) = 0;

  // Whether the guard weighs the modes of the first transmission. Where it does not, begin() has
  // decided on it, and choose_mode() is not to be called.
  virtual bool weighs() const { return false; }
  // The mode of the first transmission, which leaves `since` after t0, out of those whose forecasts
  // these are, from the best variant to the smallest; not empty.
  virtual std::size_t choose_mode(TimePoint, RoundId, Duration /*since*/,
                                  std::span<const Forecast> /*modes*/) {
    return 0;
  }

  // A remote result has come back, on time or not, `e2e` after t0.
  virtual void result(TimePoint, RoundId, Duration /*e2e*/, const Spent&) {}
  // The round was decided: on time, or answered locally although it was sent out.
  virtual void on_time(const Sent& sent) = 0;
  virtual void missed(TimePoint now, RoundId round) = 0;
};

std::unique_ptr<RoundGuard> make_round_guard(const PipelineConfig& config,
                                             const Ablation& ablation);

}  // namespace interneuron::guard
