// Processes that we start are reaped once, and those that do not want to end are ended.
#include "app/process/child.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <functional>
#include <utility>

#include "app/process/failure.h"
#include "app/process/signals.h"

namespace interneuron::process::child_test {
namespace {

using namespace std::chrono_literals;

pid_t start(const std::function<void()>& body) {
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  body();
  ::_exit(0);
}

// Until SIGTERM is ignored in the child.
pid_t start_stubborn() {
  int ready[2];
  if (::pipe(ready) != 0) return -1;
  const pid_t pid = start([&ready] {
    ::signal(SIGTERM, SIG_IGN);
    [[maybe_unused]] const ssize_t done = ::write(ready[1], "r", 1);
    for (;;) ::pause();
  });
  char byte = 0;
  EXPECT_EQ(::read(ready[0], &byte, 1), 1);
  ::close(ready[0]);
  ::close(ready[1]);
  return pid;
}

bool is_reaped(pid_t pid) { return ::waitpid(pid, nullptr, WNOHANG) < 0 && errno == ECHILD; }

TEST(Child, TellsTheExitCodeAgainAndAgain) {
  Child child(start([] { ::_exit(7); }));
  EXPECT_EQ(child.wait(), 7);
  EXPECT_EQ(child.ended(), 7);
  EXPECT_EQ(child.end(), 7);
}

TEST(Child, IsEndedAndReapedByItsDestructor) {
  const pid_t pid = start([] {
    for (;;) ::pause();
  });
  {
    Child child(pid);
    EXPECT_EQ(child.ended(), std::nullopt);
  }
  EXPECT_TRUE(is_reaped(pid));
}

TEST(Child, IsKilledWhenItDoesNotHeed) {
  Child child(start_stubborn());
  EXPECT_EQ(child.end(SIGTERM, 20ms), 128 + SIGKILL);
}

TEST(Child, ASignalToUsEndsTheWait) {
  Child child(start([] {
    for (;;) ::pause();
  }));
  const SignalWatch signals;
  ::raise(SIGINT);
  EXPECT_EQ(child.wait(), 128 + SIGTERM);
}

TEST(Child, BelongsToOne) {
  const pid_t pid = start([] {
    for (;;) ::pause();
  });
  Child first(pid);
  {
    const Child second(std::move(first));
    EXPECT_EQ(first.end(), kFine);  // nothing to end
    EXPECT_FALSE(is_reaped(pid));
  }
  EXPECT_TRUE(is_reaped(pid));
}

TEST(SignalWatch, ASignalEndsASleepAndIsTold) {
  const SignalWatch signals;
  EXPECT_EQ(SignalWatch::last(), 0);
  EXPECT_NO_THROW(SignalWatch::check());
  ::raise(SIGTERM);
  try {
    SignalWatch::sleep(1h);
    ADD_FAILURE();
  } catch (const Failure& failure) {
    EXPECT_EQ(failure.code(), 128 + SIGTERM);
  }
}

TEST(SignalWatch, LeavesAHangUpIgnoredAsNohupMeansIt) {
  const auto before = ::signal(SIGHUP, SIG_IGN);
  {
    const SignalWatch signals;
    ::raise(SIGHUP);
    EXPECT_EQ(SignalWatch::last(), 0);
  }
  ::signal(SIGHUP, before);
}

}  // namespace
}  // namespace interneuron::process::child_test
