// The answer of submit(): whether a message was taken, and if not, why. A value, because a late
// round or a lost link is nobody's programming error. Pure.
#pragma once

#include <cstdint>
#include <string_view>

namespace interneuron {

// Whatever the reason, a round that began at this endpoint still gets its answer (RoundDone) by its
// deadline. After kUnknownRound and kRoundOver nothing has changed; after each other status the
// round is handed over and is not taken a second time.
enum class SubmitStatus : std::uint8_t {
  // The message is on its way, or, after the last stage, the result is the answer of the round.
  kAccepted,
  // No round of this name was begun or delivered here lately.
  kUnknownRound,
  // The round was handed over before, was answered, or its time has passed.
  kRoundOver,
  // The remaining stages of the pipeline end here without a communication, but the round began at
  // another endpoint: nothing can carry the result there. The pipeline is wrong.
  kNoWayToOrigin,
  // The peer named is not known (any more); or none was named, and there is not exactly one.
  kNoPeer,
  // No link to the peer is up, or the policy named only links that are not.
  kNoLink,
  // The messages under way hold as many bytes as they may (EndpointOptions::send_budget_bytes).
  kOverBudget,
  // The policy decided to send nothing although a link is up; Plan::refused of the event Planned
  // says why. The round ends locally and does not count as missed.
  kRefusedByPolicy,
};

// One line for people: "accepted", "no peer: …".
std::string_view to_string(SubmitStatus status);

}  // namespace interneuron
