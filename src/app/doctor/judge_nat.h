// Judges how long silent flows stayed open (`doctor --nat-timeout`); see judge.h. Pure;
// thread-safe.
#pragma once

#include <string>

#include "app/doctor/judge.h"
#include "core/probe/silence.h"

namespace interneuron::doctor {

struct NatTimeout {
  std::string nic;
  // The longest silence that was to be tried; 0: none.
  probe::Silence limit{};
  probe::SilenceResult flows;
  // One line that says why not everything was tried; empty: everything was.
  std::string cut_short;
};

Finding judge_nat(const NatTimeout& measured);

}  // namespace interneuron::doctor
