// The program `nature_bench`: which steps a link makes, and how soon its estimates have followed.
// Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "interneuron/link.h"
#include "interneuron/time.h"

namespace interneuron::cli::bench {

// Conditions of a constant link; both directions alike.
struct Conditions {
  double rtt_ms = 0;
  double loss = 0;  // share of packets and direction
  double rate_mbit = 0;
};

enum class Quantity : std::uint8_t { kRtt, kLoss, kRate };
const char* name_of(Quantity quantity);  // "rtt", "loss", "rate"
// Of its numbers: "ms", "ratio", "mbit" (per second), as in the keys of other JSON.
const char* unit_of(Quantity quantity);

// One step: from its instant on the link has these conditions; `what` is the one that moved, from
// `before`.
struct Step {
  Quantity what{};
  Conditions before;
  Conditions after;
  double from() const;
  double to() const;
};

// The link under test is better than the reference link in everything before each step that makes
// it worse, and worse after it.
inline constexpr Conditions kBase{.rtt_ms = 40, .loss = 0, .rate_mbit = 50};
inline constexpr Conditions kReference{.rtt_ms = 60, .loss = 0.01, .rate_mbit = 25};
// Delay, loss and rate, each there and back.
std::vector<Step> steps();

// What was believed of one link at one instant since the start of the run.
struct Belief {
  Duration at{};
  double rtt_ms = 0;
  double loss = 0;
  double rate_mbit = 0;
  Nature nature{};
  Nature reference{};  // of the other link at the same instant
  double of(Quantity quantity) const;
};

// What became of a silent outage: nothing passes for a while, and nothing says so.
inline constexpr Duration kOutage = std::chrono::seconds(3);
struct PathStep {
  Duration at{};  // since the start of the run
  PathState to{};
};
struct OutageNotice {
  std::optional<Duration> suspected;  // since its beginning: the path was not OK any more
  std::optional<Duration> abandoned;  // no new data on it
  std::optional<Duration> back;       // since its end: OK again
};
OutageNotice notice(Duration began, std::span<const PathStep> steps);

// How near an estimate must be to count as there: the bounds of docs/links.md. Queues of
// our own messages are part of the round trip under load.
double tolerance(Quantity quantity, double truth, bool loaded);

struct Convergence {
  std::optional<Duration> noticed;  // first estimate nearer to the new value than to the old one
  std::optional<Duration> settled;  // from here to the end of the phase within the tolerance
  std::optional<Duration> ranked;   // from here on the score ranks both links as the truth does
  double last = 0;                  // the estimate at the end of the phase
};
// `beliefs` are those of the phase that begins at `began`, in order.
Convergence converge(const Step& step, bool loaded, Duration began,
                     std::span<const Belief> beliefs);

}  // namespace interneuron::cli::bench
