// From how long silent flows stayed open (`doctor --nat-timeout`) to a finding; see judge.h. Pure.
#pragma once

#include <string>

#include "app/doctor/judge.h"
#include "core/probe/silence.h"

namespace interneuron::cli::doctor {

struct NatTimeout {
  std::string nic;
  probe::Silence limit{};  // the longest that was to be tried; 0: none
  probe::SilenceResult flows;
  std::string cut_short;  // one line: why not all was tried; empty: it was
};

Finding judge_nat(const NatTimeout& measured);

}  // namespace interneuron::cli::doctor
