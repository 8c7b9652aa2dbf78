// The real-time guard of a pipeline: which rules there are and what they are told, what they tell
// the application of a stage, and how a computation is sacrificed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "interneuron/time.h"

namespace interneuron {

// The judgement of one stage of one round: the time θn that had elapsed when stage n ended, against
// the deadline Dn of that stage. Contains no offset between the clocks of two hosts.
struct Verdict {
  // θn > Dn: the next stage is to give up quality for time.
  bool late = false;
  // θn - Dn; positive exactly when late. kFullSeverity: everything is to be given up.
  Duration overrun{};
  // A variant that was held in the hope of a better one was delivered at exactly Dn.
  bool released_at_deadline = false;
  friend bool operator==(const Verdict&, const Verdict&) = default;
};

inline constexpr Duration kFullSeverity = Duration::max();

// Which rule guards a pipeline. Its rounds carry it in their headers: every node follows the
// origin.
enum class GuardKind : std::uint8_t {
  // The paper's rule to the letter: reference times, X, stage deadlines (docs/paper.md).
  kPaper = 0,
  // The highest expected quality of the answer, in which a miss has its price, by what remaining
  // stages took.
  kBudget = 1,
};
// "paper", "budget".
std::string_view to_string(GuardKind kind);

// A quality level of a computation, as the node that computes knows it.
struct LevelProfile {
  // Median of its run time, > 0, and the 95th percentile, which is no smaller.
  Duration median{};
  Duration p95{};
  // Expected quality of the result for each variant of the input, in [0, 1] (for detectors the
  // average precision); the last value stands for further variants.
  std::vector<double> quality{};
  friend bool operator==(const LevelProfile&, const LevelProfile&) = default;
};

// What an answer without a remote result is worth, in the same units as LevelProfile::quality. By
// default nothing is known of it, and the round's own local result is used whenever it is there.
struct FallbackQuality {
  // The quality of a round's own local result, in [0, 1].
  double local = 0;
  // stale_share[i] is the share of its quality that a remote result still has when it is i + 1
  // rounds old, in [0, 1].
  std::vector<double> stale_share{};
};

// Parameters of GuardKind::kBudget.
struct BudgetOptions {
  // What a missed round costs beyond the quality that it loses, in units of quality; in [0, 65], in
  // steps of 1/1000. The default is a little more than the best answer of our detectors is worth. A
  // higher price means fewer misses and cheaper answers.
  double miss_price = 0.5;
};

}  // namespace interneuron
