#include "netns/state/state_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "netns/state/error.h"
#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::state_file_test {
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

// What a command says of a directory that it does not use; empty: it used it.
std::string refusal(const std::filesystem::path& directory) {
  try {
    make_runtime_dir(directory);
    const RuntimeDirLock lock(directory);
  } catch (const TestbedError& error) {
    EXPECT_EQ(error.exit_code, 1);
    return error.what();
  }
  return "";
}

TEST(RuntimeDirectory, IsOursAndClosedToOthersOrRefused) {
  const RuntimeDir dir;
  EXPECT_EQ(refusal(dir.path() / "deep" / "er"), "");
  EXPECT_EQ(refusal(dir.path() / "deep" / "er"), "");
  std::filesystem::create_directory_symlink(dir.path() / "deep" / "er", dir.path() / "link");
  EXPECT_THAT(refusal(dir.path() / "link"), HasSubstr("symbolic link"));
  std::ofstream(dir.path() / "file") << "x";
  EXPECT_THAT(refusal(dir.path() / "file"), HasSubstr("no directory"));
  std::filesystem::create_directory(dir.path() / "open");
  std::filesystem::permissions(dir.path() / "open", std::filesystem::perms{0750});
  EXPECT_THAT(refusal(dir.path() / "open"), HasSubstr("chmod 700"));
  if (::geteuid() != 0) return;
  std::filesystem::create_directory(dir.path() / "foreign");
  ASSERT_EQ(::chown((dir.path() / "foreign").c_str(), 12345, 12345), 0);
  EXPECT_THAT(refusal(dir.path() / "foreign"), HasSubstr("of user 12345"));
}

// Whoever may enter the directory of another could keep that user's commands waiting for ever.
TEST(RuntimeDirectory, IsRefusedBeforeItsLockIsWaitedFor) {
  const RuntimeDir dir;
  std::filesystem::create_directory(dir.path() / "open");
  std::filesystem::permissions(dir.path() / "open", std::filesystem::perms{0755});
  const io::FileDescriptor other(::open((dir.path() / "open").c_str(), O_RDONLY | O_CLOEXEC));
  ASSERT_EQ(::flock(other.get(), LOCK_EX), 0);
  EXPECT_THAT(refusal(dir.path() / "open"), HasSubstr("chmod 700"));
}

TEST(RuntimeDirectory, EveryLookTakesAwayWhatDeadHoldersHaveLeft) {
  const RuntimeDir dir;
  const auto leave = [&] {
    State dead = example(dir);
    ++dead.holder_start_ticks;
    write_state(dead);
    return dead.file;
  };
  const std::filesystem::path foreign = dir.path() / "foreign.json";
  std::ofstream(foreign) << "{}";
  const std::filesystem::path file = leave();
  EXPECT_FALSE(Testbed::find("another", dir.path()).has_value());
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_TRUE(std::filesystem::exists(foreign)) << "not ours to remove";
  std::filesystem::remove(foreign);
  leave();
  EXPECT_TRUE(Testbed::list(dir.path()).empty());
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST(StateFile, OneThatCannotBeWrittenLeavesNothing) {
  const RuntimeDir dir;
  State state = example(dir);
  state.file = dir.path() / "none" / "x.json";
  EXPECT_THROW(write_state(state), TestbedError);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{100, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(write_state(example(dir)), TestbedError);
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

}  // namespace
}  // namespace interneuron::netns::state_file_test
