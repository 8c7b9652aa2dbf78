#include "support.h"

namespace interneuron::cli {
namespace {

class TestbedCommand : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = no_testbed();
    if (!why.empty()) GTEST_SKIP() << why;
  }
  void TearDown() override { run("testbed down --name " + name_); }
  const std::string name_ = "test-" + std::to_string(::getpid());
};

TEST_F(TestbedCommand, UpRunStatusDown) {
  Ran ran = run("testbed up --link clean --name " + name_);
  ASSERT_EQ(ran.code, 0) << ran.output;
  EXPECT_EQ(run("testbed up --link clean --name " + name_).code, 1);  // already there
  ran = run("testbed run --in vehicle --name " + name_ + " -- ping -c 2 -i 0.2 10.77.1.2");
  EXPECT_EQ(ran.code, 0) << ran.output;
  EXPECT_NE(ran.output.find("2 received"), std::string::npos) << ran.output;
  EXPECT_EQ(run("testbed run --in road --name " + name_ + " -- sh -c 'exit 42'").code, 42);
  ran = run("testbed status --json --name " + name_);
  EXPECT_EQ(ran.code, 0);
  EXPECT_NE(ran.output.find("\"schema\": \"interneuron.testbed/1\""), std::string::npos)
      << ran.output;
  EXPECT_EQ(run("testbed down --name " + name_).code, 0);
  EXPECT_EQ(run("testbed status --name " + name_).code, 1);
}

}  // namespace
}  // namespace interneuron::cli
