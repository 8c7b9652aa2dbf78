#include "netns/state_file.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

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
  state.links = {{"5g", "5g", "if5g", "10.77.1.1", "10.77.1.2"}};
  state.user_ns_fd = -1;
  state.vehicle_ns_fd = 5;
  state.road_ns_fd = 6;
  state.stats_fd = 7;
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
  EXPECT_EQ(read->links[0].nic, "if5g");
  EXPECT_EQ(read->links[0].road_address, "10.77.1.2");
  EXPECT_EQ(read->user_ns_fd, -1);
  EXPECT_EQ(read->stats_fd, 7);
  EXPECT_TRUE(holder_alive(*read));
}

TEST(StateFile, NoneIsNone) {
  const RuntimeDir dir;
  EXPECT_FALSE(read_state(state_path(dir.path(), "x")).has_value());
}

TEST(StateFile, AForeignOneIsRefusedByName) {
  const RuntimeDir dir;
  const auto file = state_path(dir.path(), "x");
  for (const char* text : {"", "{", "[]", "{\"schema\": 2}", "{\"schema\": 1}", "nonsense"}) {
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
