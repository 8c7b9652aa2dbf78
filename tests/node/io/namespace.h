// A network namespace of the test's own, with a pair of network cards:
//
//   va 10.99.0.1/24 ── veth ── vb      (both in it; nobody answers at vb, 10.99.0.2 is only a
//   neighbour that va is told of)
//
// Works for an ordinary user where user namespaces are allowed.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <string>

#include "node/io/file_descriptor.h"

namespace interneuron::io {

// Exit codes of the child: what CTest takes for skipped, and an assertion that failed.
inline constexpr int kSkip = 77;
inline constexpr int kFailure = 1;

inline bool write_file(const char* path, const std::string& text) {
  const FileDescriptor file(::open(path, O_WRONLY | O_CLOEXEC));
  return ::write(file.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

// Whose privileges a test has in its namespace: those of the namespace alone, or those of the host
// as well, as BPF programs need them; without the latter it is skipped.
enum class Root { kOfNamespace, kOfHost };

inline bool enter_namespace(Root root) {
  if (root == Root::kOfHost) return ::unshare(CLONE_NEWNET) == 0;
  const std::string uid = std::to_string(::getuid());
  const std::string gid = std::to_string(::getgid());
  if (::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
    // A sanitizer's threads forbid a user namespace, and root needs none.
    return ::unshare(CLONE_NEWNET) == 0;
  }
  write_file("/proc/self/setgroups", "deny");
  return write_file("/proc/self/uid_map", "0 " + uid + " 1") &&
         write_file("/proc/self/gid_map", "0 " + gid + " 1");
}

inline bool shell(const std::string& command) {
  return std::system(("PATH=$PATH:/sbin:/usr/sbin; " + command + " 2>/dev/null").c_str()) == 0;
}

// Runs `body` in a child with namespaces of its own, so that nothing is left behind. GoogleTest's
// assertions work in it: the child prints them, and the test fails or is skipped as the body was.
inline void in_namespace(const std::function<void()>& body, Root root = Root::kOfNamespace) {
  std::fflush(nullptr);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const bool ready = enter_namespace(root) && shell("ip link set lo up") &&
                       shell("ip link add va type veth peer name vb") &&
                       shell("ip addr add 10.99.0.1/24 dev va") && shell("ip link set va up") &&
                       shell("ip link set vb up") &&
                       // No answer to ARP comes from vb, so the neighbour is told.
                       shell("ip neigh add 10.99.0.2 lladdr 02:00:00:00:00:02 dev va");
    if (!ready) ::_exit(kSkip);
    try {
      body();
    } catch (const std::exception& error) {
      ADD_FAILURE() << "threw: " << error.what();
    }
    std::fflush(nullptr);
    if (testing::Test::HasFailure()) ::_exit(kFailure);
    ::_exit(testing::Test::IsSkipped() ? kSkip : 0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kSkip) GTEST_SKIP() << "needs user namespaces or root, ip and tc";
  EXPECT_EQ(WEXITSTATUS(status), 0) << "what failed in the namespace is printed above";
}

// A second network namespace, for NICs to be moved to. For use inside in_namespace().
class OtherNamespace {
 public:
  OtherNamespace() {
    int ready[2];
    if (::pipe(ready) != 0) return;
    child_ = ::fork();
    if (child_ == 0) {
      const char done = ::unshare(CLONE_NEWNET) == 0 ? 'y' : 'n';
      if (::write(ready[1], &done, 1) == 1) ::pause();
      ::_exit(0);
    }
    char done = 'n';
    made_ = ::read(ready[0], &done, 1) == 1 && done == 'y';
    ::close(ready[0]);
    ::close(ready[1]);
  }
  ~OtherNamespace() {
    ::kill(child_, SIGKILL);
    ::waitpid(child_, nullptr, 0);
  }
  OtherNamespace(const OtherNamespace&) = delete;
  OtherNamespace& operator=(const OtherNamespace&) = delete;

  bool made() const { return made_; }
  // A process in it.
  pid_t process() const { return child_; }
  // Runs a command in it.
  bool shell(const std::string& command) const {
    return io::shell("nsenter -t " + std::to_string(child_) + " -n " + command);
  }
  bool take(const std::string& nic) const {
    return io::shell("ip link set " + nic + " netns " + std::to_string(child_));
  }
  bool give_back(const std::string& nic) const {
    return shell("ip link set " + nic + " netns " + std::to_string(::getpid()));
  }

 private:
  pid_t child_ = -1;
  bool made_ = false;
};

}  // namespace interneuron::io
