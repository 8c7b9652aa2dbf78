// What the tests of src/emu share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "emu/profile.h"

namespace interneuron::emu {

inline LinkProfile profile_of(const std::string& name) {
  const auto profile = built_in_profile(name);
  EXPECT_TRUE(profile.has_value()) << name;
  return profile.value_or(LinkProfile{});
}

// A process that is `rtt_ms` for ever.
inline DelayParams constant_delay(double rtt_ms, double loss = 0) {
  DelayParams params;
  for (RadioStateParams& state : params.states) {
    state.level_ms = rtt_ms;
    state.loss = loss;
  }
  params.min_ms = params.max_ms = rtt_ms;
  return params;
}

inline LinkModel constant_link(DirectionParams direction, double rtt_ms, double loss = 0,
                               std::uint64_t seed = 1) {
  return {direction, std::make_shared<DelayProcess>(constant_delay(rtt_ms, loss), seed), seed};
}

}  // namespace interneuron::emu
