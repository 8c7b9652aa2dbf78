// What the tests of src/emu share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "emu/link.h"

namespace interneuron::emu {

inline LinkProfile profile_of(const std::string& name) {
  const auto profile = built_in_profile(name);
  EXPECT_TRUE(profile.has_value()) << name;
  return profile.value_or(LinkProfile{});
}

inline LinkModel constant_link(const DirectionParams& direction, double rtt_ms, double loss = 0,
                               std::uint64_t seed = 1) {
  auto process = std::make_shared<DelayProcess>(constant_delay(rtt_ms, loss), seed);
  return {direction, std::make_shared<Channel>(std::move(process)), Direction::kUp, seed};
}

}  // namespace interneuron::emu
