// Pipelines and rounds: one round handles one frame through N stages; the application gets exactly
// one answer per round, by t0 + D_N (docs/paper.md, "Rounds and stages").
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/guard.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron {

enum class StageKind : std::uint8_t { kCommunication, kComputation };

inline constexpr std::size_t kMaxStages = 16;  // chosen; the header has a bit per stage

struct PipelineConfig {
  PipelineId id{};
  // 1 … N; the last one ends at the origin. Uplink, detection, downlink is
  // {kCommunication, kComputation, kCommunication}.
  std::vector<StageKind> stages;
  Duration deadline = std::chrono::milliseconds(130);  // D_N, > 0; default: the paper's
  Duration period = std::chrono::milliseconds(100);    // between rounds, > 0
  std::string policy = "down_sampling";
  Nature needs{.delay = 1.0};  // weights in [0, 1], carried in every header
  // β, added to X, in 1/1000 (docs/paper.md, "X and the timeout handler").
  std::int16_t beta_permille = 0;
  bool use_x = true;        // false: X stays 0 (ablation)
  bool use_handler = true;  // false: a miss changes nothing (ablation)
  GuardKind guard = GuardKind::kBudget;
  BudgetOptions budget{};  // of GuardKind::kBudget
  // What is known beforehand of the remote computation, from the lowest quality to the highest;
  // kBudget weighs with it what a transmission is worth. Empty: learnt from the results.
  std::vector<LevelProfile> levels{};
  FallbackQuality fallback{};
};

// Names a round anywhere: the endpoint that began it, its pipeline, its number.
struct RoundRef {
  SessionId origin{};
  PipelineId pipeline{};
  RoundId round{};
  friend auto operator<=>(const RoundRef&, const RoundRef&) = default;
};

// What is known of a round's outcome.
enum class RoundState : std::uint8_t { kUnknown = 0, kOnTime = 1, kMissed = 2 };

// The indicator (docs/paper.md, "Indicator"): the header of round r carries the states of the 16
// rounds before it; [i] is round r - 1 - i.
inline constexpr std::size_t kIndicatorRounds = 16;
using Indicator = std::array<RoundState, kIndicatorRounds>;

enum class Outcome : std::uint8_t {
  kRemote,  // a remote result was there by D_N: on time
  kLocal,   // none was: a timeout, answered locally
};

// The one answer of a round.
struct RoundDone {
  RoundRef round;
  Outcome outcome{};
  TimePoint t0{};
  Duration e2e{};  // from t0 to this answer
  // Remote: the result. Local: the backup's result of this round, or, when it was not ready, the
  // last result there is.
  Bytes result;
  // Of a local answer: it is the last remote result instead of this round's own local one.
  bool stale_remote = false;
  std::optional<std::uint32_t>
      age_rounds;  // of `result`: 0 = this round's; nothing = there is no result at all
  bool degraded_final = false;  // the last communication was sent degraded (D_{N-1} missed)
  bool recovering = false;      // the round was begun while the timeout handler recovers
  std::int16_t x_permille = 0;  // X that the round was sent with
};

// A message that the guard and the policy hand to the application at the end of a communication
// stage.
struct Delivered {
  RoundRef round;
  PeerId from{};
  std::uint8_t stage = 0;  // the stage that ended, 1 … N-1
  std::uint8_t variant = 0;
  bool degraded = false;  // it was sent degraded
  Verdict verdict;
  Duration deadline{};  // D_N of the pipeline
  QoS qos;
  Bytes payload;
};

}  // namespace interneuron
