// What a StatusLine writes to a terminal, and that it writes nothing elsewhere.
#include "app/process/status_line.h"

#include <gtest/gtest.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <string>

namespace interneuron::process::status_line_test {
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

// All that was written to the other end of `fd`, which is closed by now: a terminal hands it over
// in several parts, and when it likes.
std::string read_all(int fd) {
  std::string all;
  std::array<char, 4096> buffer{};
  for (;;) {
    const ssize_t size = ::read(fd, buffer.data(), buffer.size());
    if (size <= 0) return all;
    all.append(buffer.data(), static_cast<std::size_t>(size));
  }
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
  ::close(screen);
  EXPECT_EQ(read_all(terminal),
            "\r\x1b[Jone\ntwo"
            "\x1b[1A\r\x1b[Jthree"
            "\n"
            "\r\x1b[Jfour"
            "\r\x1b[J");
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
  ::close(ends[1]);
  EXPECT_EQ(read_all(ends[0]), "");
  ::close(ends[0]);
}

}  // namespace
}  // namespace interneuron::process::status_line_test
