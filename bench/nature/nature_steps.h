// Which steps the tested link of `nature_bench` makes, and how soon its estimates have followed
// each. Pure; thread-compatible; no errors.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "interneuron/link.h"
#include "interneuron/time.h"

namespace interneuron::bench {

// Conditions of a constant link; both directions alike.
struct Conditions {
  double rtt_ms = 0;
  // The share of packets lost in each direction, from 0 to 1.
  double loss = 0;
  double rate_mbit = 0;
};

enum class Quantity : std::uint8_t { kRtt, kLoss, kRate };
// "rtt", "loss" or "rate".
const char* name_of(Quantity quantity);
// "ms", "ratio" or "mbit" (per second), as in the keys of all JSON that the project writes.
const char* unit_of(Quantity quantity);

// One step changes one quantity, `what`: the conditions are `before` until it and `after` from it.
struct Step {
  Quantity what{};
  Conditions before;
  Conditions after;
  double from() const;
  double to() const;
};

// The base conditions of the tested link are better than those of the reference link in every
// quantity. A step that makes one of them worse makes it worse than the reference's, so that the
// ranking of the two links must turn round.
inline constexpr Conditions kBase{.rtt_ms = 40, .loss = 0, .rate_mbit = 50};
inline constexpr Conditions kReference{.rtt_ms = 60, .loss = 0.01, .rate_mbit = 25};
// All steps: delay, loss and rate, each there and back.
std::vector<Step> steps();

// The estimates of the tested link at one instant, which is since the start of the run.
struct Belief {
  Duration at{};
  double rtt_ms = 0;
  double loss = 0;
  double rate_mbit = 0;
  // The scores of the tested link and of the reference link.
  Nature nature{};
  Nature reference{};
  double of(Quantity quantity) const;
};

// The length of a silent outage: nothing passes, and no event tells of it.
inline constexpr Duration kOutage = std::chrono::seconds(3);
// A change of the path's state, since the start of the run.
struct PathStep {
  Duration at{};
  PathState to{};
};
// When an outage was noticed; empty: not at all.
struct OutageNotice {
  // Since its beginning: when the path was no longer OK, and when it got no new data.
  std::optional<Duration> suspected;
  std::optional<Duration> abandoned;
  // Since its end: when the path was OK again.
  std::optional<Duration> back;
};
// `began` is when the outage began, since the start of the run.
OutageNotice notice(Duration began, std::span<const PathStep> steps);

// The largest difference from `truth` with which an estimate counts as right, in the quantity's
// unit: the bounds of docs/links.md. Under load that of the round trip is wider, since the queue of
// our own messages is part of it, and that of the rate is narrower, since messages measure it.
double tolerance(Quantity quantity, double truth, bool loaded);

// How an estimate followed a step; times are since the step. Empty: it did not.
struct Convergence {
  // The first estimate that is nearer to the new value than to the old one.
  std::optional<Duration> noticed;
  // From here to the end of the phase the estimate is within the tolerance.
  std::optional<Duration> settled;
  // From here on the scores rank both links as their true conditions do.
  std::optional<Duration> ranked;
  // The estimate at the end of the phase.
  double last = 0;
};
// `beliefs` are those of the phase that begins at `began`, in order of time.
Convergence converge(const Step& step, bool loaded, Duration began,
                     std::span<const Belief> beliefs);

}  // namespace interneuron::bench
