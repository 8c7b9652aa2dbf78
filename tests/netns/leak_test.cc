// Up and down, many times: nothing is left of it. INTERNEURON_TEST_CYCLES sets how many times.
#include <gmock/gmock.h>
#include <net/if.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::leak_test {
namespace {

// Enough to see a leak (kNamespaceLimit), and some seconds.
constexpr int kCycles = 30;
// A testbed of one vehicle has 4 network namespaces, and the kernel frees those of the last few
// cycles in the background: leaking one in each cycle would exceed it for good.
constexpr int kNamespaceLimit = 24;

int cycles() {
  const char* text = std::getenv("INTERNEURON_TEST_CYCLES");
  return text == nullptr ? kCycles : std::atoi(text);
}

std::size_t entries(const char* directory) {
  const std::filesystem::directory_iterator list(directory);
  return static_cast<std::size_t>(std::distance(begin(list), end(list)));
}

std::size_t count_nics() {
  struct if_nameindex* list = ::if_nameindex();
  std::size_t count = 0;
  while (list != nullptr && list[count].if_index != 0) ++count;
  ::if_freenameindex(list);
  return count;
}

std::size_t count_holders() {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "comm");
    std::string name;
    if (std::getline(file, name) && name.starts_with("interneuron-")) ++count;
  }
  return count;
}

bool write_text(const char* path, const std::string& text) {
  std::ofstream file(path);
  file << text << std::flush;
  return static_cast<bool>(file);
}

// A user namespace of our own, whose count of network namespaces the kernel itself limits.
bool enter_limited() {
  const std::string uid = std::to_string(::geteuid());
  return ::unshare(CLONE_NEWUSER) == 0 && write_text("/proc/self/uid_map", "0 " + uid + " 1") &&
         write_text("/proc/sys/user/max_net_namespaces", std::to_string(kNamespaceLimit));
}

// Up and down once. How soon the kernel frees the namespaces of the cycles before is its own
// affair, which takes many seconds on a busy machine, so that a cycle may have to wait for them;
// those that somebody still holds never come.
void cycle(const RuntimeDir& dir) {
  std::string refused;
  const bool done = eventually(
      [&] {
        try {
          Testbed::up(clean_options(dir)).down();
          return true;
        } catch (const TestbedError& error) {
          refused = error.what();
          return false;
        }
      },
      std::chrono::minutes(2));
  if (!done) throw std::runtime_error(refused);
}

class LeakTest : public NetnsTest {};

TEST_F(LeakTest, CyclesLeaveNothing) {
  const int count = cycles();
  const std::size_t holders = count_holders();  // of others; some may be about to end
  constexpr int kNoLimit = 77;
  const int code = in_child([&] {
    if (!enter_limited()) return kNoLimit;
    std::size_t fds = 0;
    std::size_t nics = 0;
    for (int i = 0; i < count; ++i) {
      cycle(dir_);
      // After the first, which may leave what stays open for good.
      if (i == 0) fds = entries("/proc/self/fd");
      if (i == 0) nics = count_nics();
    }
    if (entries("/proc/self/fd") != fds) return 90;
    if (count_nics() != nics) return 91;
    return ::waitpid(-1, nullptr, WNOHANG) < 0 && errno == ECHILD ? 0 : 92;
  });
  if (code == kNoLimit) GTEST_SKIP() << "may not limit user.max_net_namespaces";
  EXPECT_EQ(code, 0) << "90: file descriptors, 91: NICs, 92: processes, 255: see above";
  EXPECT_TRUE(eventually([&] { return count_holders() <= holders; }));
  EXPECT_TRUE(dir_.empty());
}

}  // namespace
}  // namespace interneuron::netns::leak_test
