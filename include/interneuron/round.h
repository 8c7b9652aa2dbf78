// A round and what the application is told of it; pipeline.h says what rounds are. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "interneuron/guard.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron {

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
  // A remote result was there by the end-to-end deadline: the round is on time.
  kRemote,
  // None was, so the round was answered locally.
  kLocal,
};

// The one answer of a round. The endpoint that began the round is told of it.
struct RoundDone {
  RoundRef round;
  Outcome outcome{};
  // When the round began.
  TimePoint t0{};
  // From t0 to this answer.
  Duration e2e{};
  // The remote result or, for a local outcome, this round's own local result; if that is not there,
  // the last result of any kind, which may be empty.
  Bytes result;
  // The outcome is local, and `result` is the last remote result instead of this round's own local
  // one.
  bool stale_remote = false;
  // How many rounds ago `result` was asked for: 0 for this round's; nothing when there is no result
  // at all.
  std::optional<std::uint32_t> age_rounds;
  // The last message was sent degraded, because the stage before it ended late.
  bool degraded_final = false;
  // Where the guard is kPaper: the round was begun while the handler of misses recovers, and the
  // tolerance X that the round was sent with, in 1/1000.
  bool recovering = false;
  std::int16_t x_permille = 0;
};

// A message is there and the application is to work on it: a communication stage of the round has
// ended at this endpoint. Answer with submit().
struct Delivered {
  RoundRef round;
  // Who sent it.
  PeerId from{};
  // The stage that ended, counted from 1; always before the last one.
  std::uint8_t stage = 0;
  // Which variant it is; 0 is the best.
  std::uint8_t variant = 0;
  // The sender's guard gave up quality for time.
  bool degraded = false;
  // Whether this stage ended late.
  Verdict verdict;
  // The end-to-end deadline of the pipeline, counted from t0; the same as qos.deadline.
  Duration deadline{};
  QoS qos;
  // What the sender submitted.
  Bytes payload;
};

}  // namespace interneuron
