// What the tests of the evaluation share.
#pragma once

#include <gtest/gtest.h>

#include "lab/eval/bounds.h"
#include "lab/eval/metrics.h"
#include "lab/eval/run.h"
#include "tests/lab/sim/support.h"

namespace interneuron::eval {

using sim::kSanitized;

inline const System& named(const std::string& name) {
  const System* system = find_system(name);
  EXPECT_NE(system, nullptr) << name;
  return *system;
}

// A trace without noise in which only these rounds are injected.
inline Trace script(std::uint32_t rounds,
                    const std::vector<std::pair<std::uint32_t, Injected>>& injected) {
  Trace trace;
  trace.rounds.resize(rounds);
  trace.compute_noise.resize(rounds);
  for (const auto& [round, what] : injected) trace.rounds[round] = what;
  return trace;
}

inline Injected at(Module module, Duration delay) { return {true, module, delay}; }

inline DelayLaw exponential_law() { return DelayLaw{.shape = DelayLaw::Shape::kExponential}; }

}  // namespace interneuron::eval
