// `links` and `top` as users run them, with a roadside unit on the loopback card of a namespace.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/prctl.h>
#include <termios.h>
#include <utmp.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "support.h"
#include "tests/app/watch/json_schema.h"
#include "tests/node/io/namespace.h"

namespace interneuron::cli::links_command_test {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;

// A roadside unit that serves; ended with this object.
class Road {
 public:
  Road() {
    int out[2];
    if (::pipe2(out, O_CLOEXEC) != 0) return;
    pid_ = ::fork();
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // a test that crashes leaves nothing running
      ::dup2(out[1], STDOUT_FILENO);
      const int null = ::open("/dev/null", O_RDWR);
      ::dup2(null, STDERR_FILENO);
      const std::string picture = places::source() + "/docs/latency.png";
      const char* const program = places::program().c_str();
      ::execl(program, program, "road", "--insecure", "--nic", "lo,trusted", "--ladder", "motion",
              "--calibration-runs", "1", "--video", picture.c_str(), nullptr);
      ::_exit(127);
    }
    ::close(out[1]);
    std::string text;
    char byte = 0;
    while (text.find("\nready") == std::string::npos && ::read(out[0], &byte, 1) == 1) text += byte;
    ready_ = text.find("\nready") != std::string::npos;
    out_ = out[0];
  }
  ~Road() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
    ::close(out_);
  }
  bool ready() const { return ready_; }

 private:
  pid_t pid_ = -1;
  int out_ = -1;
  bool ready_ = false;
};

json link_named(const json& report, const std::string& name) {
  for (const json& link : report["links"]) {
    if (link["name"] == name) return link;
  }
  return {};
}

TEST(LinksCommand, WithoutAnyoneTheKernelsFactsAreShown) {
  io::in_namespace([] {
    const json report = json::parse(run("links --json", false).output);
    for (const std::string& what : watch::violations(watch::schema_of("links.json"), report)) {
      std::printf("%s\n", what.c_str());
    }
    EXPECT_TRUE(watch::violations(watch::schema_of("links.json"), report).empty())
        << "JSON as its schema says";
    const json va = link_named(report, "va");
    EXPECT_EQ(va["kind"], "veth") << "va is a veth without a route";
    EXPECT_EQ(va["state"], "no_route") << "va is a veth without a route";
    EXPECT_EQ(va["addresses"][0], "10.99.0.1") << "va's address";
    EXPECT_TRUE(va["rtt_ms"].is_null()) << "nothing measured";
    EXPECT_TRUE(va["nature"].is_null()) << "nothing measured";
    const Ran table = run("links");
    EXPECT_EQ(table.code, 0) << "exit code 0";
    EXPECT_THAT(table.output, testing::HasSubstr("--peer HOST")) << "what to do is named";
  });
}

TEST(LinksCommand, MeasuresTowardsAPeerAndAProgramTellsItsOwn) {
  io::in_namespace([] {
    const Road road;
    ASSERT_TRUE(road.ready()) << "a roadside unit that is ready";
    const Ran ran = run("links --insecure --peer 127.0.0.1 --for 1.5 --json", false);
    const json report = json::parse(ran.output);
    EXPECT_EQ(ran.code, 0) << "exit code 0";
    for (const std::string& what : watch::violations(watch::schema_of("links.json"), report)) {
      std::printf("%s\n", what.c_str());
      ADD_FAILURE();
    }
    // The road measures towards us as well, so lo has a row of each.
    const json lo = link_named(report, "lo");
    EXPECT_EQ(lo["program"], "links") << "a round trip";
    EXPECT_TRUE(lo["rtt_ms"]["p50"].is_number()) << "a round trip";
    EXPECT_GT(lo["evidence"]["received_packets"], 0) << "packets of the road";
  });
}

TEST(LinksCommand, AProgramTellsWhatItMeasures) {
  io::in_namespace([] {
    const Road road;
    ASSERT_TRUE(road.ready()) << "a roadside unit that is ready";
    // Somebody for the road to measure towards.
    std::thread other([] { run("links --insecure --peer 127.0.0.1 --for 6 --json", false); });
    json lo;
    const auto told = [&lo] { return lo.contains("program") && lo["program"] == "road"; };
    for (int i = 0; i < 5 && !told(); ++i) {
      lo = link_named(json::parse(run("links --json", false).output, nullptr, false), "lo");
    }
    other.join();
    EXPECT_TRUE(told()) << "the road's view of lo";
    EXPECT_TRUE(lo["path"].is_string()) << "the road's view of lo";
  });
}

TEST(LinksCommand, AStreamIsALinePerInterval) {
  io::in_namespace([] {
    const Ran ran = run("links --json-stream --interval 0.1 --for 0.55", false);
    int lines = 0;
    std::size_t at = 0;
    for (std::size_t end; (end = ran.output.find('\n', at)) != std::string::npos; at = end + 1) {
      ++lines;
      ASSERT_TRUE(json::accept(ran.output.substr(at, end - at))) << "JSON per line";
    }
    EXPECT_EQ(ran.code, 0) << "some lines";
    EXPECT_GE(lines, 2) << "some lines";
    EXPECT_LE(lines, 6) << "some lines";
  });
}

TEST(LinksCommand, ASilentPeerIsNamedBesideTheTable) {
  io::in_namespace([] {
    const Ran ran = run("links --insecure --peer 127.0.0.1:9 --for 0.5");
    EXPECT_EQ(ran.code, 1) << "exit code 1";
    EXPECT_THAT(ran.output, testing::HasSubstr("no answer from 127.0.0.1:9")) << "its name";
    EXPECT_THAT(ran.output, testing::HasSubstr("NIC")) << "the table all the same";
  });
}

TEST(TopCommand, OneFrameAsText) {
  io::in_namespace([] {
    const Ran ran = run("top --once --for 0.1 --width 90");
    EXPECT_EQ(ran.code, 0) << "exit code 0";
    EXPECT_THAT(ran.output, testing::HasSubstr("interneuron top")) << "its title";
    EXPECT_THAT(ran.output, testing::HasSubstr("va")) << "the card";
  });
}

// On a real terminal: what it drew, how it ended, and whether the terminal is as it was.
struct Session {
  std::string screen;
  int code = -1;
  bool restored = false;
};

Session on_a_terminal(const std::string& key, int signal, bool color) {
  Session session;
  winsize size{.ws_row = 24, .ws_col = 90, .ws_xpixel = 0, .ws_ypixel = 0};
  int master = -1;
  int slave = -1;
  if (::openpty(&master, &slave, nullptr, nullptr, &size) != 0) return session;
  termios before{};
  ::tcgetattr(slave, &before);
  const pid_t child = ::fork();
  if (child == 0) {
    ::login_tty(slave);
    ::setenv("TERM", "xterm-256color", 1);
    ::setenv("LC_ALL", "C.UTF-8", 1);
    if (!color) ::setenv("NO_COLOR", "1", 1);
    const char* const program = places::program().c_str();
    ::execl(program, program, "top", nullptr);
    ::_exit(127);
  }
  const auto read_until = [&](const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (session.screen.find(text) == std::string::npos &&
           std::chrono::steady_clock::now() < end) {
      pollfd item{master, POLLIN, 0};
      if (::poll(&item, 1, 100) <= 0) continue;
      char chunk[4096];
      const ssize_t n = ::read(master, chunk, sizeof chunk);
      if (n <= 0) return;
      session.screen.append(chunk, static_cast<std::size_t>(n));
    }
  };
  read_until("newest first");
  size.ws_col = 60;
  ::ioctl(master, TIOCSWINSZ, &size);
  if (!key.empty()) {
    [[maybe_unused]] const ssize_t done = ::write(master, key.data(), key.size());
  }
  if (signal != 0) ::kill(child, signal);
  read_until("\x1b[?1049l");  // back to the screen that was there before
  int status = 0;
  ::waitpid(child, &status, 0);
  session.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  termios after{};
  ::tcgetattr(slave, &after);
  session.restored = before.c_lflag == after.c_lflag && before.c_iflag == after.c_iflag &&
                     session.screen.find("\x1b[?1049l") != std::string::npos;
  ::close(master);
  ::close(slave);
  return session;
}

TEST(TopCommand, DrawsAndLeavesTheTerminalAsItWas) {
  const Session quit = on_a_terminal("q", 0, true);
  EXPECT_EQ(quit.code, 0);
  EXPECT_TRUE(quit.restored);
  EXPECT_NE(quit.screen.find("interneuron top"), std::string::npos);
  const Session ended = on_a_terminal("", SIGTERM, true);
  EXPECT_EQ(ended.code, 128 + SIGTERM);
  EXPECT_TRUE(ended.restored);
  const Session interrupted = on_a_terminal("\x03", 0, true);  // Ctrl-C
  EXPECT_EQ(interrupted.code, 128 + SIGINT);
  EXPECT_TRUE(interrupted.restored);
}

TEST(TopCommand, NoColorMeansNone) {
  EXPECT_NE(on_a_terminal("q", 0, true).screen.find("\x1b[32m"), std::string::npos);
  const std::string plain = on_a_terminal("q", 0, false).screen;
  EXPECT_EQ(plain.find("\x1b[32m"), std::string::npos);
  EXPECT_NE(plain.find("newest first"), std::string::npos);
}

}  // namespace
}  // namespace interneuron::cli::links_command_test
