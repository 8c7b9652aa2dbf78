#include "core/flow/path_view.h"

#include <gtest/gtest.h>

namespace interneuron::flow::completion_law_test {
namespace {

using namespace std::chrono_literals;

TEST(CompletionLaw, BelievesRatesAtFirst) {
  const CompletionLaw law;
  EXPECT_EQ(law.mean(), 0);
  EXPECT_NEAR(law.deviation(), 0.1, 1e-9);
}

TEST(CompletionLaw, LearnsByHowMuchAPathIsSlowerThanBelieved) {
  CompletionLaw law;
  for (int i = 0; i < 100; ++i) law.learn(10ms, 20ms);
  EXPECT_NEAR(law.mean(), 0.5, 0.01);
  EXPECT_LT(law.deviation(), 0.05);
}

TEST(CompletionLaw, AndHowMuchThatVaries) {
  CompletionLaw law;
  for (int i = 0; i < 100; ++i) law.learn(i % 2 == 0 ? 10ms : -10ms, 20ms);
  EXPECT_NEAR(law.mean(), 0, 0.1);
  EXPECT_NEAR(law.deviation(), 0.5, 0.1);
}

TEST(CompletionLaw, AStallOrATinyMessageSaysLittle) {
  CompletionLaw law;
  law.learn(10s, 20ms);
  EXPECT_LE(law.mean(), 0.5);
  const double before = law.mean();
  law.learn(1s, 1ms);
  EXPECT_EQ(law.mean(), before);
}

}  // namespace
}  // namespace interneuron::flow::completion_law_test
