#include "app/watch/live_state.h"

#include <gmock/gmock.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstddef>

namespace interneuron::watch::live_state_test {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::Not;

std::string name(const char* what) { return LiveServer::own_name() + "." + what; }

// Long, because the machine may be loaded; a test that passes waits for what it sees.
template <class Condition>
bool eventually(Condition condition) {
  const auto end = std::chrono::steady_clock::now() + 20s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

TEST(LiveState, AReaderGetsTheNewestLine) {
  LiveServer server(name("newest"));
  ASSERT_EQ(server.problem(), "");
  EXPECT_FALSE(server.wanted());
  LiveReader reader;
  reader.lines();
  ASSERT_TRUE(eventually([&] { return server.wanted(); }));
  server.publish("one");
  EXPECT_TRUE(eventually([&] { return testing::Value(reader.lines(), Contains("one")); }));
  server.publish("two");
  EXPECT_TRUE(eventually([&] { return testing::Value(reader.lines(), Contains("two")); }));
  EXPECT_THAT(reader.lines(), Not(Contains("one")));
}

TEST(LiveState, WithoutDescriptorsItPausesAndGoesOnLater) {
  LiveServer server(name("descriptors"));
  LiveReader reader;
  reader.lines();
  ASSERT_TRUE(eventually([&] { return server.wanted(); }));
  const io::FileDescriptor client(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  name("descriptors").copy(to.sun_path + 1, sizeof to.sun_path - 1);
  const auto size =
      static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name("descriptors").size());
  rlimit before{};
  ::getrlimit(RLIMIT_NOFILE, &before);
  const io::FileDescriptor next(::dup(0));
  const auto limit = static_cast<rlim_t>(next.get());
  const auto began = std::chrono::steady_clock::now();
  const rlimit none{limit, before.rlim_max};
  ::setrlimit(RLIMIT_NOFILE, &none);
  ASSERT_EQ(::connect(client.get(), reinterpret_cast<const sockaddr*>(&to), size), 0);
  ASSERT_TRUE(eventually([&] { return server.refusals() > 0; }));
  // Each line wakes its thread, which looks for readers then.
  for (int i = 0; i < 200; ++i) {
    server.publish("line " + std::to_string(i));
    std::this_thread::yield();
  }
  ASSERT_TRUE(eventually([&] { return server.refusals() > 1; })) << "it tries again by itself";
  const auto refusals = server.refusals();
  const auto passed = std::chrono::steady_clock::now() - began;
  ::setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_LE(refusals, 1U + static_cast<std::uint64_t>(passed / LiveServer::kPause));
  // The one who waited is served.
  std::array<char, 64> line{};
  ASSERT_TRUE(eventually([&] {
    server.publish("after");
    return ::recv(client.get(), line.data(), line.size(), MSG_DONTWAIT) > 0;
  }));
}

TEST(LiveState, NothingIsLeftBehindAndReadersNoticeTheEnd) {
  LiveReader reader;
  {
    LiveServer server(name("end"));
    reader.lines();
    ASSERT_TRUE(eventually([&] { return server.wanted(); }));
    server.publish("last");
    ASSERT_TRUE(eventually([&] { return testing::Value(reader.lines(), Contains("last")); }));
    EXPECT_THAT(LiveReader::names(), Contains(name("end")));
  }
  EXPECT_TRUE(eventually([&] { return testing::Value(reader.lines(), Not(Contains("last"))); }));
  EXPECT_THAT(LiveReader::names(), Not(Contains(name("end"))));
}

TEST(LiveState, AServerThatIsKilledLeavesNothingEither) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const std::string taken = name("killed");
  const pid_t child = ::fork();
  if (child == 0) {
    LiveServer server(taken);
    [[maybe_unused]] const ssize_t done = ::write(ready[1], "r", 1);
    ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_THAT(LiveReader::names(), Contains(taken));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_THAT(LiveReader::names(), Not(Contains(taken)));
  LiveServer server(taken);
  EXPECT_EQ(server.problem(), "");
}

TEST(LiveState, ASecondServerOfTheNameSaysWhyItDoesNotServe) {
  LiveServer first(name("twice"));
  LiveServer second(name("twice"));
  EXPECT_NE(second.problem().find("Address already in use"), std::string::npos) << second.problem();
}

// Larger than what a socket holds; the reader takes it in parts.
TEST(LiveState, ALineAsLargeAsManyLinksArrivesWhole) {
  LiveServer server(name("large"));
  LiveReader reader;
  reader.lines();
  ASSERT_TRUE(eventually([&] { return server.wanted(); }));
  const std::string line(3'000'000, 'x');
  server.publish(line);
  EXPECT_TRUE(eventually([&] { return testing::Value(reader.lines(), Contains(line)); }));
}

TEST(LiveState, AReaderThatDoesNotReadIsDropped) {
  LiveServer server(name("slow"));
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  name("slow").copy(address.sun_path + 1, name("slow").size());
  const auto size =
      static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name("slow").size());
  ASSERT_EQ(::connect(socket, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_TRUE(eventually([&] { return server.wanted(); }));
  const std::string line(1'000'000, 'x');
  EXPECT_TRUE(eventually([&] {
    server.publish(line);
    return !server.wanted();
  }));
  ::close(socket);
}

// Only root can become another user to try it.
TEST(LiveState, AnotherUserIsNotAnswered) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root";
  LiveServer server(name("private"));
  const std::string where = name("private");
  const pid_t child = ::fork();
  if (child == 0) {
    constexpr uid_t kNobody = 65534;
    if (::setuid(kNobody) != 0) ::_exit(2);
    const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    where.copy(address.sun_path + 1, where.size());
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + where.size());
    if (::connect(socket, reinterpret_cast<sockaddr*>(&address), size) != 0) ::_exit(3);
    char byte = 0;
    ::_exit(::read(socket, &byte, 1) == 0 ? 0 : 1);  // closed without a word
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_FALSE(server.wanted());
}

}  // namespace
}  // namespace interneuron::watch::live_state_test
