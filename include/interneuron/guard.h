// What the real-time guard (NOTES §4) tells the application of a stage, and how a computation is
// sacrificed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

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

// The level of a computation (NOTES §4.4). `runtimes`: median run time per level, from the lowest
// quality to the highest; `chosen`: the level otherwise chosen. When late: the best level at least
// one step below `chosen` whose run time makes up for the overrun, R[level] <= R[chosen] - overrun;
// else the lowest.
std::size_t sacrificed_level(std::span<const Duration> runtimes, std::size_t chosen,
                             const Verdict& verdict);

}  // namespace interneuron
