// What a StatusLine writes to a terminal, and that it writes nothing elsewhere.
#include "host/process/status_line.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <string>

namespace interneuron::cli {
namespace {

// Stands `fd` in for stderr while it lives.
class Stderr {
 public:
  explicit Stderr(int fd) : saved_(::dup(STDERR_FILENO)) { ::dup2(fd, STDERR_FILENO); }
  ~Stderr() {
    ::dup2(saved_, STDERR_FILENO);
    ::close(saved_);
  }
  Stderr(const Stderr&) = delete;
  Stderr& operator=(const Stderr&) = delete;

 private:
  int saved_;
};

// What `fd` has to read now.
std::string read_all(int fd) {
  ::fcntl(fd, F_SETFL, O_NONBLOCK);
  std::array<char, 4096> buffer{};
  const ssize_t size = ::read(fd, buffer.data(), buffer.size());
  return {buffer.data(), size > 0 ? static_cast<std::size_t>(size) : 0};
}

TEST(StatusLine, WritesOverWhatATerminalShowed) {
  int terminal = -1;
  int screen = -1;
  // Raw, so that the terminal changes no byte.
  termios raw{};
  ::cfmakeraw(&raw);
  ASSERT_EQ(::openpty(&terminal, &screen, nullptr, &raw, nullptr), 0);
  {
    const Stderr redirected(screen);
    StatusLine line;
    EXPECT_TRUE(line.live());
    line.clear();
    line.show("one\ntwo");
    line.show("three");
    line.keep();
    line.show("four");
    line.clear();
    line.clear();
  }
  EXPECT_EQ(read_all(terminal),
            "\r\x1b[Jone\ntwo"
            "\x1b[1A\r\x1b[Jthree"
            "\n"
            "\r\x1b[Jfour"
            "\r\x1b[J");
  ::close(screen);
  ::close(terminal);
}

TEST(StatusLine, WritesNothingIntoALog) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  {
    const Stderr redirected(ends[1]);
    StatusLine line;
    EXPECT_FALSE(line.live());
    line.show("one");
    line.keep();
    line.show("two");
    line.clear();
  }
  EXPECT_EQ(read_all(ends[0]), "");
  ::close(ends[0]);
  ::close(ends[1]);
}

}  // namespace
}  // namespace interneuron::cli
