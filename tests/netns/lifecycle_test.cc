// Up, found, down, and nothing left.
#include <dirent.h>
#include <gmock/gmock.h>
#include <net/if.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <set>

#include "netns/state/error.h"
#include "netns/state/state_file.h"
#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::lifecycle_test {
namespace {

using testing::HasSubstr;

std::set<std::string> nics() {
  std::set<std::string> out;
  struct if_nameindex* list = ::if_nameindex();
  for (auto* item = list; item != nullptr && item->if_index != 0; ++item) out.insert(item->if_name);
  ::if_freenameindex(list);
  return out;
}

// Inode of the vehicle's namespace; something in /proc refers to it as long as it lives.
ino_t vehicle_inode(const State& state) {
  struct stat status {};
  const std::string path =
      "/proc/" + std::to_string(state.holder) + "/fd/" + std::to_string(state.vehicle_ns_fds.at(0));
  EXPECT_EQ(::stat(path.c_str(), &status), 0);
  return status.st_ino;
}

bool any_process_in(ino_t network_namespace) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    struct stat status {};
    const std::string path = entry.path() / "ns/net";
    if (::stat(path.c_str(), &status) == 0 && status.st_ino == network_namespace) return true;
  }
  return false;
}

class LifecycleTest : public NetnsTest {};

TEST_F(LifecycleTest, UpFindDown) {
  const auto before = nics();
  TestbedOptions options = clean_options(dir_);
  options.scenario = default_scenario();
  options.scenario.seed = 7;
  Testbed testbed = Testbed::up(options);
  EXPECT_EQ(nics(), before);  // nothing of it is visible outside

  const auto found = Testbed::find("default", dir_.path());
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->holder, testbed.state().holder);
  EXPECT_EQ(found->seed, 7U);
  EXPECT_EQ(found->links.size(), 2U);
  EXPECT_EQ(found->links[1].vehicle_address, "10.78.1.2");
  EXPECT_EQ(Testbed::list(dir_.path()).size(), 1U);
  EXPECT_FALSE(Testbed::find("other", dir_.path()).has_value());

  const ino_t inode = vehicle_inode(*found);
  testbed.down();
  EXPECT_FALSE(start_ticks(found->holder).has_value());
  EXPECT_FALSE(any_process_in(inode));
  EXPECT_TRUE(dir_.empty());
  EXPECT_EQ(nics(), before);
  EXPECT_FALSE(Testbed::find("default", dir_.path()).has_value());
  Testbed::down(*found);  // once more does no harm
}

TEST_F(LifecycleTest, DestructorEndsIt) {
  State state;
  {
    const Testbed testbed = Testbed::up(clean_options(dir_));
    state = testbed.state();
    EXPECT_TRUE(holder_alive(state));
  }
  EXPECT_FALSE(holder_alive(state));
  EXPECT_TRUE(dir_.empty());
}

TEST_F(LifecycleTest, AForkDoesNotEndIt) {
  Testbed testbed = Testbed::up(clean_options(dir_));
  in_child([&] {
    const Testbed copy = std::move(testbed);
    return 0;
  });
  EXPECT_TRUE(holder_alive(testbed.state()));
}

TEST_F(LifecycleTest, ASecondOfTheSameNameIsRefused) {
  const Testbed testbed = Testbed::up(clean_options(dir_));
  try {
    Testbed::up(clean_options(dir_));
    ADD_FAILURE() << "no refusal";
  } catch (const TestbedError& error) {
    EXPECT_EQ(error.exit_code, 1);
    EXPECT_EQ(std::string(error.what()),
              "testbed 'default' is already up (pid " + std::to_string(testbed.state().holder) +
                  "); `interneuron testbed down --name default` ends it");
  }
  TestbedOptions other = clean_options(dir_);
  other.name = "other";
  const Testbed second = Testbed::up(other);
  EXPECT_EQ(Testbed::list(dir_.path()).size(), 2U);
}

TEST_F(LifecycleTest, AfterSigkillOnlyAStaleFileIsLeftAndFindRemovesIt) {
  const auto before = nics();
  TestbedOptions options = clean_options(dir_);
  options.detached = true;
  const State state = Testbed::up(options).state();
  const ino_t inode = vehicle_inode(state);
  ASSERT_EQ(::kill(state.holder, SIGKILL), 0);
  ASSERT_TRUE(eventually([&] { return !holder_alive(state); }));
  EXPECT_FALSE(any_process_in(inode));
  EXPECT_EQ(nics(), before);
  EXPECT_FALSE(dir_.empty());
  EXPECT_FALSE(Testbed::find("default", dir_.path()).has_value());
  EXPECT_TRUE(dir_.empty());

  const Testbed again = Testbed::up(clean_options(dir_));  // and the name is free
}

TEST_F(LifecycleTest, AFileThatNamesAReusedPidIsStale) {
  {
    Testbed testbed = Testbed::up(clean_options(dir_));
    State other = testbed.state();
    testbed.down();
    other.holder = ::getpid();
    write_state(other);
  }
  EXPECT_FALSE(Testbed::find("default", dir_.path()).has_value());
  EXPECT_TRUE(dir_.empty());
}

TEST_F(LifecycleTest, SigtermEndsItCleanly) {
  TestbedOptions options = clean_options(dir_);
  options.detached = true;
  const State state = Testbed::up(options).state();
  ASSERT_EQ(::kill(state.holder, SIGTERM), 0);
  ASSERT_TRUE(eventually([&] { return !holder_alive(state); }));
  EXPECT_TRUE(dir_.empty());
}

TEST_F(LifecycleTest, DetachedOutlivesItsMaker) {
  EXPECT_EQ(in_child([&] {
              TestbedOptions options = clean_options(dir_);
              options.detached = true;
              Testbed::up(options);
              return 0;
            }),
            0);
  const auto state = Testbed::find("default", dir_.path());
  ASSERT_TRUE(state.has_value());
  EXPECT_EQ(Testbed::run_in(*state, kVehicle, {"true"}), 0);
  Testbed::down(*state);
  EXPECT_FALSE(holder_alive(*state));
  EXPECT_TRUE(dir_.empty());
}

TEST_F(LifecycleTest, AttachedDiesWithItsMaker) {
  EXPECT_EQ(in_child([&] {
              const Testbed testbed = Testbed::up(clean_options(dir_));
              ::kill(::getpid(), SIGKILL);
              return 0;
            }),
            128 + SIGKILL);
  EXPECT_TRUE(eventually([&] { return !Testbed::find("default", dir_.path()).has_value(); }));
  EXPECT_TRUE(dir_.empty());
}

TEST_F(LifecycleTest, WrongOptionsAreRefusedBeforeAnythingIsMade) {
  const auto refusal = [&](const std::function<void(TestbedOptions&)>& change) {
    TestbedOptions options = clean_options(dir_);
    change(options);
    try {
      Testbed::up(options);
    } catch (const TestbedError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  EXPECT_THAT(refusal([](auto& o) { o.name = "a/b"; }), HasSubstr("the name of a testbed 'a/b'"));
  EXPECT_THAT(refusal([](auto& o) { o.scenario.links.clear(); }),
              HasSubstr("1 to 16 links, not 0"));
  EXPECT_THAT(refusal([](auto& o) { o.scenario.links[0].name = "fourteen-chars"; }),
              HasSubstr("must have 1 to 13 characters"));
  EXPECT_THAT(refusal([](auto& o) { o.scenario.links.push_back(o.scenario.links[0]); }),
              HasSubstr("two links are called 'clean'"));
  EXPECT_TRUE(dir_.empty());
}

}  // namespace
}  // namespace interneuron::netns::lifecycle_test
