#include "app/records/verdict.h"

#include <gtest/gtest.h>

#include "app/process/failure.h"

namespace interneuron::records::verdict_test {
namespace {

Json summary_of(int rounds, int on_time, int local, int refused = 0) {
  return {{"rounds", rounds}, {"answers", on_time + local}, {"on_time", on_time},
          {"local", local},   {"refused", refused},         {"deadline_ms", 130.0}};
}

TEST(Verdict, IsOneSentenceThatSaysWhoAnswered) {
  EXPECT_EQ(verdict(summary_of(300, 298, 2)),
            "298 of 300 rounds answered by the roadside unit within 130 ms; 2 answered by the "
            "vehicle itself.");
  EXPECT_EQ(verdict(summary_of(300, 300, 0)),
            "300 of 300 rounds answered by the roadside unit within 130 ms.");
  EXPECT_EQ(verdict(summary_of(5, 0, 5, 4)),
            "0 of 5 rounds answered by the roadside unit within 130 ms; 5 answered by the vehicle "
            "itself, 4 because the policy sent nothing.");
  EXPECT_EQ(verdict(summary_of(5, 3, 1)),
            "3 of 5 rounds answered by the roadside unit within 130 ms; 1 answered by the vehicle "
            "itself; 1 unanswered.");
  EXPECT_EQ(verdict(summary_of(0, 0, 0)), "No round was begun.");
}

TEST(Verdict, TheObjectiveIsAShareOfTheRounds) {
  EXPECT_EQ(judge_objective(summary_of(100, 98, 2), 0), process::kFine);
  EXPECT_EQ(judge_objective(summary_of(100, 98, 2), 98), process::kFine);
  testing::internal::CaptureStderr();
  EXPECT_EQ(judge_objective(summary_of(100, 98, 2), 99), process::kObjectiveMissed);
  EXPECT_EQ(judge_objective(summary_of(0, 0, 0), 1), process::kObjectiveMissed);
  EXPECT_NE(testing::internal::GetCapturedStderr().find("98.0 %"), std::string::npos);
}

}  // namespace
}  // namespace interneuron::records::verdict_test
