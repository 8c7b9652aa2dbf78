#include "netns/state/state_file.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

#include "netns/state/error.h"
#include "support.h"

namespace interneuron::netns {
namespace {

using testing::HasSubstr;

State example(const RuntimeDir& dir) {
  State state;
  state.name = "x";
  state.holder = ::getpid();
  state.holder_start_ticks = start_ticks(::getpid()).value();
  state.detached = true;
  state.seed = 0xffff'ffff'ffff'fffeU;
  state.backend = Backend::kNetem;
  state.nat = true;
  state.links = {{"5g", 1, "five", "if5g", "10.77.2.2", "10.77.2.1", "10.77.0.1", "fd77:0:1:2::2",
                  "fd77:0:1:2::1", "fd77:0:1::1"}};
  state.user_ns_fd = -1;
  state.vehicle_ns_fds = {5, 8};
  state.road_ns_fds = {6};
  state.core_ns_fd = 9;
  state.stats_fd = 7;
  state.control = "interneuron-x";
  state.control_token = "secret";
  state.file = state_path(dir.path(), "x");
  return state;
}

TEST(StateFile, ReadsWhatItWrote) {
  const RuntimeDir dir;
  const State written = example(dir);
  write_state(written);
  const auto read = read_state(written.file);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->name, written.name);
  EXPECT_EQ(read->holder, written.holder);
  EXPECT_EQ(read->holder_start_ticks, written.holder_start_ticks);
  EXPECT_EQ(read->detached, written.detached);
  EXPECT_EQ(read->seed, written.seed);
  ASSERT_EQ(read->links.size(), 1U);
  const TestbedLink& link = read->links[0];
  EXPECT_EQ(link.name, "5g");
  EXPECT_EQ(link.vehicle, 1U);
  EXPECT_EQ(link.profile, "five");
  EXPECT_EQ(link.nic, "if5g");
  EXPECT_EQ(link.vehicle_address, "10.77.2.2");
  EXPECT_EQ(link.gateway, "10.77.2.1");
  EXPECT_EQ(link.road_address, "10.77.0.1");
  EXPECT_EQ(link.vehicle_address6, "fd77:0:1:2::2");
  EXPECT_EQ(link.gateway6, "fd77:0:1:2::1");
  EXPECT_EQ(link.road_address6, "fd77:0:1::1");
  EXPECT_EQ(read->backend, Backend::kNetem);
  EXPECT_TRUE(read->nat);
  EXPECT_EQ(read->user_ns_fd, -1);
  EXPECT_EQ(read->vehicle_ns_fds, (std::vector{5, 8}));
  EXPECT_EQ(read->road_ns_fds, std::vector{6});
  EXPECT_EQ(read->core_ns_fd, 9);
  EXPECT_EQ(read->stats_fd, 7);
  EXPECT_EQ(read->control, "interneuron-x");
  EXPECT_EQ(read->control_token, "secret");
  EXPECT_TRUE(holder_alive(*read));
}

TEST(StateFile, OnlyTheOwnerReadsTheToken) {
  const RuntimeDir dir;
  const State state = example(dir);
  write_state(state);
  write_state(state);  // also over one that is there
  EXPECT_EQ(std::filesystem::status(state.file).permissions(), std::filesystem::perms{0600});
}

TEST(StateFile, NoneIsNone) {
  const RuntimeDir dir;
  EXPECT_FALSE(read_state(state_path(dir.path(), "x")).has_value());
}

TEST(StateFile, AForeignOneIsRefusedByName) {
  const RuntimeDir dir;
  const auto file = state_path(dir.path(), "x");
  for (const char* text :
       {"", "{", "[]", "{\"schema\": 1}", "{\"schema\": 2}", "{\"schema\": 3}", "nonsense"}) {
    std::ofstream(file) << text;
    try {
      read_state(file);
      ADD_FAILURE() << text;
    } catch (const TestbedError& error) {
      EXPECT_EQ(error.exit_code, 1);
      EXPECT_THAT(error.what(), HasSubstr(file.string()));
    }
  }
}

TEST(StateFile, AProcessIsKnownByPidAndStart) {
  const RuntimeDir dir;
  State state = example(dir);
  ++state.holder_start_ticks;
  EXPECT_FALSE(holder_alive(state));
  EXPECT_FALSE(start_ticks(0x3fffffff).has_value());
}

TEST(StateFile, NamesAreChecked) {
  EXPECT_THROW(state_path("/tmp", "../x"), TestbedError);
  EXPECT_THROW(state_path("/tmp", ""), TestbedError);
  EXPECT_THROW(state_path("/tmp", std::string(65, 'x')), TestbedError);
  EXPECT_EQ(state_path("/tmp", "a-B_9"), "/tmp/a-B_9.json");
}

TEST(StateFile, RuntimeDirectoryMustBeOurs) {
  const RuntimeDir dir;
  make_runtime_dir(dir.path() / "deep" / "er");
  EXPECT_TRUE(std::filesystem::is_directory(dir.path() / "deep" / "er"));
  std::filesystem::create_directory_symlink("/tmp", dir.path() / "link");
  EXPECT_THROW(make_runtime_dir(dir.path() / "link"), TestbedError);
  std::ofstream(dir.path() / "file") << "x";
  EXPECT_THROW(make_runtime_dir(dir.path() / "file"), TestbedError);
}

}  // namespace
}  // namespace interneuron::netns
