// Programs inside a testbed: exit codes, signals, namespaces.
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>

#include "netns/state/error.h"
#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::run_test {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

class RunTest : public NetnsTest {
 protected:
  void SetUp() override {
    NetnsTest::SetUp();
    if (IsSkipped()) return;
    testbed_.emplace(Testbed::up(clean_options(dir_)));
  }

  std::string output_of(Host host, const std::vector<std::string>& argv) {
    return netns::output_of(testbed_->state(), host, argv);
  }

  std::optional<Testbed> testbed_;
};

TEST_F(RunTest, ReturnsTheExitCode) {
  const State& state = testbed_->state();
  EXPECT_EQ(Testbed::run_in(state, kVehicle, {"true"}), 0);
  EXPECT_EQ(Testbed::run_in(state, kRoad, {"sh", "-c", "exit 42"}), 42);
  EXPECT_EQ(Testbed::run_in(state, kRoad, {"sh", "-c", "kill -9 $$"}), 128 + SIGKILL);
}

TEST_F(RunTest, HostsAreNamespacesOfTheirOwnWithTheNics) {
  const std::string here = std::filesystem::read_symlink("/proc/self/ns/net");
  const std::string vehicle = output_of(kVehicle, {"readlink", "/proc/self/ns/net"});
  const std::string road = output_of(kRoad, {"readlink", "/proc/self/ns/net"});
  EXPECT_THAT(vehicle, HasSubstr("net:["));
  EXPECT_NE(vehicle, road);
  EXPECT_NE(vehicle, here + "\n");
  EXPECT_NE(road, here + "\n");
  const std::string devices = output_of(kVehicle, {"cat", "/proc/net/dev"});
  EXPECT_THAT(devices, HasSubstr("ifclean:"));
  EXPECT_THAT(devices, HasSubstr("lo:"));
  // The neighbour is known for good (flags 0x6): asking for it would cross the emulated link.
  EXPECT_THAT(output_of(kVehicle, {"cat", "/proc/net/arp"}),
              ContainsRegex("10.77.1.1 .*0x6 .*02:77:01:01:00:02"));
  EXPECT_THAT(output_of(kRoad, {"cat", "/proc/net/arp"}),
              ContainsRegex("10.77.0.254 .*0x6 .*02:77:01:01:00:04"));
  // No link-local address anywhere: with it come packets that nobody sent.
  for (const Host host : {kVehicle, kRoad, kCore}) {
    EXPECT_THAT(output_of(host, {"cat", "/proc/net/if_inet6"}), Not(HasSubstr("fe80")));
  }
}

TEST_F(RunTest, AHostThatIsNotThereIsNamed) {
  const auto refusal = [&](Host host) {
    try {
      Testbed::run_in(testbed_->state(), host, {"true"});
    } catch (const TestbedError& error) {
      return std::to_string(error.exit_code) + " " + error.what();
    }
    return std::string("none");
  };
  EXPECT_EQ(refusal({Host::Kind::kVehicle, 2}),
            "2 testbed 'default' has no vehicle3; it has vehicle, road, core");
  EXPECT_EQ(refusal({Host::Kind::kRoad, 1}),
            "2 testbed 'default' has no road2; it has vehicle, road, core");
  EXPECT_EQ(refusal(kCore), "none");
}

TEST_F(RunTest, WhatCannotBeRunIsNamed) {
  const State& state = testbed_->state();
  const auto refusal = [&](const std::vector<std::string>& argv) {
    try {
      Testbed::run_in(state, kVehicle, argv);
    } catch (const TestbedError& error) {
      return std::to_string(error.exit_code) + " " + error.what();
    }
    return std::string("none");
  };
  EXPECT_EQ(refusal({"./no-such-program"}),
            "127 cannot run './no-such-program': No such file or directory");
  EXPECT_EQ(refusal({"/etc"}), "126 cannot run '/etc': Permission denied");
  EXPECT_THAT(refusal({}), HasSubstr("2 no command to run"));
}

TEST_F(RunTest, ForwardsSignals) {
  const State state = testbed_->state();
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  const pid_t runner = ::fork();
  if (runner == 0) {
    ::dup2(ends[1], STDOUT_FILENO);
    const int code = Testbed::run_in(
        state, kVehicle,
        {"sh", "-c", "trap 'exit 7' TERM; echo ready; while :; do sleep 0.01; done"});
    ::_exit(code);
  }
  ::close(ends[1]);
  ASSERT_TRUE(readable(ends[0], 5000));  // the trap is set
  ::kill(runner, SIGTERM);
  int status = 0;
  ASSERT_EQ(::waitpid(runner, &status, 0), runner);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  ::close(ends[0]);
}

TEST_F(RunTest, AGoneTestbedIsNamed) {
  const State state = testbed_->state();
  testbed_->down();
  try {
    Testbed::run_in(state, kVehicle, {"true"});
    ADD_FAILURE();
  } catch (const TestbedError& error) {
    EXPECT_THAT(error.what(), HasSubstr("testbed 'default' is not up any more"));
  }
}

}  // namespace
}  // namespace interneuron::netns::run_test
