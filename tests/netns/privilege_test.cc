// Ordinary users: with user namespaces everything works, without them the setting in the way is
// named.
#include <gmock/gmock.h>
#include <grp.h>
#include <linux/capability.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>

#include "netns/state/error.h"
#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::privilege_test {
namespace {

constexpr unsigned kNobody = 65534;

void drop_capabilities() {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct none[2]{};
  if (::syscall(SYS_capset, &header, none) != 0) ::_exit(99);
}

// Prints to the test's output what went wrong.
int attempt(const std::function<int()>& body) {
  try {
    return body();
  } catch (const TestbedError& error) {
    std::fprintf(stderr, "%d %s\n", error.exit_code, error.what());
    return error.exit_code;
  }
}

class PrivilegeTest : public NetnsTest {};

TEST_F(PrivilegeTest, AnOrdinaryUserGetsAUserNamespace) {
  const bool root = ::geteuid() == 0;
  ASSERT_TRUE(!root || ::chown(dir_.path().c_str(), kNobody, kNobody) == 0);
  EXPECT_EQ(
      in_child([&] {
        if (::geteuid() == 0) {
          if (::setgroups(0, nullptr) != 0 || ::setgid(kNobody) != 0 || ::setuid(kNobody) != 0)
            return 98;
        }
        return attempt([&] {
          Testbed testbed = Testbed::up(clean_options(dir_));
          if (testbed.state().user_ns_fd < 0) return 97;
          // Root within, so that programs there may use raw sockets and set routes.
          const int code =
              Testbed::run_in(testbed.state(), kRoad, {"sh", "-c", "test $(id -u) = 0"});
          if (code != 0) return 96;
          if (testbed.snapshot().links.size() != 1) return 95;
          testbed.down();
          return dir_.empty() ? 0 : 94;
        });
      }),
      0);
}

TEST_F(PrivilegeTest, TheSettingInTheWayIsNamed) {
  testing::internal::CaptureStderr();
  const int code = in_child([&] {
    // A limit of 0 in a namespace of our own is as good as one of the machine, and harms nobody.
    if (::unshare(CLONE_NEWUSER) != 0) return 98;
    std::ofstream limit("/proc/sys/user/max_user_namespaces");
    limit << 0 << std::flush;
    if (!limit) return 97;
    drop_capabilities();
    return attempt([&] {
      Testbed::up(clean_options(dir_));
      return 0;
    });
  });
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(code, 5) << text;
  EXPECT_THAT(text, testing::HasSubstr("user.max_user_namespaces is 0"));
  EXPECT_TRUE(dir_.empty());
}

TEST_F(PrivilegeTest, AnotherUsersDirectoryIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root to give a directory away";
  ASSERT_EQ(::chown(dir_.path().c_str(), kNobody, kNobody), 0);
  EXPECT_THROW(Testbed::up(clean_options(dir_)), TestbedError);
}

}  // namespace
}  // namespace interneuron::netns::privilege_test
