#include <gtest/gtest.h>

#include <chrono>

#include "host/io/steady_clock.h"

namespace interneuron::io::clock_test {
namespace {

TEST(SteadyClock, IsTheClockThatTimersWaitOn) {
  const auto before = std::chrono::steady_clock::now().time_since_epoch();
  const auto ours = now().time_since_epoch();
  const auto after = std::chrono::steady_clock::now().time_since_epoch();
  EXPECT_LE(before, ours);
  EXPECT_LE(ours, after);
}

}  // namespace
}  // namespace interneuron::io::clock_test
