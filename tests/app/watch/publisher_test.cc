#include "app/watch/publisher.h"

#include <gtest/gtest.h>

namespace interneuron::watch::publisher_test {
namespace {

TEST(LinkPublisher, ALoadedPathThatIsSuspectForAMomentIsNoWarning) {
  using spdlog::level::debug;
  using spdlog::level::info;
  using spdlog::level::warn;
  EXPECT_EQ(log_level(PathState::kOk, PathState::kSuspect), debug);
  EXPECT_EQ(log_level(PathState::kSuspect, PathState::kOk), debug);
  for (const PathState unusable : {PathState::kPulled, PathState::kLatched, PathState::kDead}) {
    EXPECT_EQ(log_level(PathState::kSuspect, unusable), warn);
    EXPECT_EQ(log_level(unusable, PathState::kSuspect), info);
    EXPECT_EQ(log_level(unusable, PathState::kOk), info);
  }
}

}  // namespace
}  // namespace interneuron::watch::publisher_test
