// The real-time guard of a pipeline: which rules there are and what they are told, what they tell
// the application of a stage, and how a computation is sacrificed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "interneuron/time.h"

namespace interneuron {

// The judgement of one stage of one round: θn against Dn. Contains no clock offset.
struct Verdict {
  bool late = false;   // θn > Dn: the next module is to be sacrificed
  Duration overrun{};  // θn - Dn, > 0 exactly when late; Duration::max() = full severity
  bool released_at_deadline =
      false;  // a held variant was used at exactly Dn (the paper's white dots)
  friend bool operator==(const Verdict&, const Verdict&) = default;
};

inline constexpr Duration kFullSeverity = Duration::max();

// Which rule guards a pipeline. Its rounds carry it in their headers: every node follows the
// origin.
enum class GuardKind : std::uint8_t {
  // The paper's rule to the letter: reference times, X, stage deadlines (docs/paper.md).
  kPaper = 0,
  // The highest expected quality subject to P(on time) >= target, from what remaining stages took.
  kBudget = 1,
};
std::string_view to_string(GuardKind kind);  // "paper", "budget"

// A quality level of a computation, as its node knows it.
struct LevelProfile {
  Duration median{};  // run time, > 0
  Duration p95{};     // >= median
  // Expected quality of the result per variant of the input, in [0, 1] (for detectors: AP); the
  // last one stands for further variants.
  std::vector<double> quality{};
};

// What an answer without a remote result is worth, in the same units as LevelProfile::quality.
// Empty: the fresh local result wins whenever it is there.
struct FallbackQuality {
  double local = 0;  // this round's own local result
  // [i]: share of its quality that a remote result still has when it is i + 1 rounds old.
  std::vector<double> stale_share{};
};

// Parameters of GuardKind::kBudget. Target and price ride in the headers, in steps of 1/65536 and
// 1/1000.
struct BudgetOptions {
  // P(round on time) that is kept wherever enough rounds were seen to know that some choice keeps
  // it and the most valuable one does not; in (0, 1).
  double target = 0.99;
  // What a missed round costs beyond the quality that it loses, in units of quality; in [0, 65].
  // The default is a little more than the best answer of our detectors is worth. It decides where
  // no choice keeps the target: a higher price, fewer misses and cheaper answers.
  double miss_price = 0.5;
  // Share of rounds that may try a mode of transmission not tried for 10 s, while it is expected to
  // keep the target; every so-many-th round, not at random. In [0, 0.2]. (Levels need none: what
  // one of them shows of delays holds for all.)
  double exploration = 0.02;
};

// The level of a computation (docs/paper.md, "Sacrifice"). `runtimes`: median run time per level,
// from the lowest quality to the highest; `chosen`: the level otherwise chosen. When late: the best
// level at least one step below `chosen` whose run time makes up for the overrun, R[level] <=
// R[chosen] - overrun; else the lowest.
std::size_t sacrificed_level(std::span<const Duration> runtimes, std::size_t chosen,
                             const Verdict& verdict);

}  // namespace interneuron
