// What other users of this host, full disks and exhausted limits can do to the program: an exit
// code, one line, and nothing half-written.
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <thread>

#include "support.h"

namespace interneuron::cli::local_faults_test {
namespace {

namespace fs = std::filesystem;

// Through a shell, where "$0" is the program.
Ran in_shell(const std::string& script) {
  std::string quoted;
  for (const char c : script) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return run_program("sh", "-c '" + quoted + "' '" + places::program() + "'");
}

bool one_line(const Ran& ran) {
  return std::ranges::count(ran.output, '\n') == 1 && ran.output.starts_with("interneuron: ");
}

std::string read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(FullDisk, OutputThatDoesNotGetOutIsAFailure) {
  for (const std::string command :
       {"version", "--version", "--help", "links", "links --json", "testbed list",
        "testbed schedule --seconds 1", "demo --help", "bench transports --help"}) {
    const Ran ran = in_shell("\"$0\" " + command + " 2>&1 >/dev/full");
    EXPECT_EQ(ran.code, 1) << command << ": " << ran.output;
    EXPECT_TRUE(one_line(ran)) << command << ": " << ran.output;
    EXPECT_NE(ran.output.find("No space left on device"), std::string::npos) << ran.output;
  }
}

TEST(FullDisk, AReaderThatHasSeenEnoughIsNoFailure) {
  const Ran ran = in_shell("\"$0\" testbed schedule --seconds 20 | head -n 1");
  EXPECT_EQ(ran.code, 0) << ran.output;
}

// A file system of its own with room for `kilobytes`; the folder is "$D" in the script. In a
// namespace of users, so that anybody may mount it; code 77 where there are none.
Ran on_small_disk(int kilobytes, const fs::path& folder, const std::string& script) {
  return in_shell("D='" + folder.string() +
                  "'; export D; unshare -Urm true || exit 77; unshare -Urm sh -c '" +
                  "mount -t tmpfs -o size=" + std::to_string(kilobytes) +
                  "k tmpfs \"$D\" || exit 77; " + script + "' \"$0\"");
}

TEST(FullDisk, AFileIsNamedWithTheReasonAndNothingIsLeft) {
  const TempFolder folder;
  // The folder itself takes none of the two pages of 4 KiB; the rest of the picture finds no room.
  const Ran ran = on_small_disk(
      8, folder.string(),
      "\"$0\" testbed schedule --seconds 20 --plot \"$D\"/x.svg; c=$?; ls -A \"$D\"; exit $c");
  if (ran.code == 77) GTEST_SKIP() << "needs the privilege to mount: " << ran.output;
  if (ran.output.find("gnuplot") != std::string::npos) GTEST_SKIP() << ran.output;
  EXPECT_EQ(ran.code, 1) << ran.output;
  EXPECT_TRUE(one_line(ran)) << ran.output;
  EXPECT_NE(ran.output.find("x.svg': No space left on device; make room"), std::string::npos)
      << ran.output;
}

TEST(Gnuplot, NamesOfFilesAreNoCommands) {
  const TempFolder folder;
  for (const std::string name : {"a'b\"c; touch x", "`touch x`", "'; !touch x; '", "$(touch x)"}) {
    const fs::path place = folder / name;
    fs::create_directory(place);
    std::ofstream(folder / "script") << "cd '" << folder.string() << "' && \"$1\" testbed schedule "
                                     << "--seconds 1 --plot \"$(cat name)/p.png\"\n";
    std::ofstream(folder / "name") << name;
    const Ran ran =
        run_program("sh", (folder / "script").string() + " '" + places::program() + "'");
    if (ran.output.find("install the package gnuplot") != std::string::npos) GTEST_SKIP();
    EXPECT_EQ(ran.code, 0) << ran.output;
    EXPECT_EQ(read(place / "p.png").substr(0, 4), "\x89PNG") << name;
    EXPECT_FALSE(fs::exists(folder / "x")) << name;
  }
}

TEST(Gnuplot, NamesInProfilesAreNoCommands) {
  const TempFolder folder;
  const std::string name = "it's `touch x`";
  std::ofstream(folder / (name + ".toml")) << read(places::source() + "/tc_profiles/clean.toml");
  std::ofstream(folder / "script")
      << "cd '" << folder.string() << "' && \"$1\" testbed schedule --profile \"a=./"
      << "it's "
      << "\\`touch x\\`.toml\" --seconds 1 --plot p.svg\n";
  const Ran ran = run_program("sh", (folder / "script").string() + " '" + places::program() + "'");
  if (ran.output.find("install the package gnuplot") != std::string::npos) GTEST_SKIP();
  EXPECT_EQ(ran.code, 0) << ran.output;
  EXPECT_FALSE(fs::exists(folder / "x"));
}

// Each command that looks for testbeds, as another user of the host might have prepared it.
class RuntimeFolder : public testing::TestWithParam<const char*> {
 protected:
  Ran run_in(const fs::path& xdg) {
    return in_shell("XDG_RUNTIME_DIR='" + xdg.string() + "' timeout 20 \"$0\" " + GetParam());
  }
  void expect_refusal(const std::string& says) {
    const Ran ran = run_in(folder_ / "run");
    EXPECT_EQ(ran.code, 1) << ran.output;
    EXPECT_TRUE(one_line(ran)) << ran.output;
    EXPECT_NE(ran.output.find((folder_ / "run/interneuron").string()), std::string::npos)
        << ran.output;
    EXPECT_NE(ran.output.find(says), std::string::npos) << ran.output;
  }
  TempFolder folder_;
};

TEST_P(RuntimeFolder, ThatOthersMayEnterIsRefusedEvenWhenTheyLockIt) {
  fs::create_directories(folder_ / "run/interneuron");
  fs::permissions(folder_ / "run/interneuron", fs::perms{0755});
  const int other = ::open((folder_ / "run/interneuron").c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_EQ(::flock(other, LOCK_EX), 0);
  expect_refusal("chmod 700");
  ::close(other);
}

TEST_P(RuntimeFolder, ThatIsASymbolicLinkIsRefused) {
  fs::create_directories(folder_ / "elsewhere");
  fs::permissions(folder_ / "elsewhere", fs::perms{0700});
  fs::create_directories(folder_ / "run");
  fs::create_directory_symlink(folder_ / "elsewhere", folder_ / "run/interneuron");
  expect_refusal("symbolic link");
  fs::remove(folder_ / "run/interneuron");
  fs::create_directory_symlink(folder_ / "nowhere", folder_ / "run/interneuron");
  expect_refusal("symbolic link");
}

TEST_P(RuntimeFolder, ThatBelongsToAnotherUserIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root to give a folder away";
  fs::create_directories(folder_ / "run/interneuron");
  fs::permissions(folder_ / "run/interneuron", fs::perms{0700});
  ASSERT_EQ(::chown((folder_ / "run/interneuron").c_str(), 12345, 12345), 0);
  expect_refusal("of user 12345");
}

INSTANTIATE_TEST_SUITE_P(Commands, RuntimeFolder,
                         testing::Values("testbed up --link clean", "testbed down", "testbed list",
                                         "testbed status", "testbed run -- true",
                                         "testbed set 5g up.loss=0.1", "testbed event 5g outage 5s",
                                         "testbed verify"),
                         [](const auto& test) {
                           const std::string command = test.param;
                           return command.substr(8, command.find(' ', 8) - 8);
                         });

TEST(Killed, ADemoLeavesNothingThatTheNextCommandDoesNotRemove) {
  if (const std::string why = no_testbed(); !why.empty()) GTEST_SKIP() << why;
  const TempFolder folder;
  fs::create_directory(folder / "run");
  const pid_t demo = ::fork();
  ASSERT_GE(demo, 0);
  if (demo == 0) {
    ::setenv("XDG_RUNTIME_DIR", (folder / "run").c_str(), 1);
    ::setenv("TMPDIR", folder.string().c_str(), 1);
    const int log = ::open((folder / "log").c_str(), O_CREAT | O_WRONLY, 0600);
    ::dup2(log, 1);
    ::dup2(log, 2);
    const std::string picture = places::source() + "/docs/latency.png";
    ::execl(places::program().c_str(), "interneuron", "demo", "--ladder", "motion", "--video",
            picture.c_str(), "--out", (folder / "out").c_str(), nullptr);
    ::_exit(127);
  }
  const fs::path state = folder / "run/interneuron" / ("demo-" + std::to_string(demo) + ".json");
  const auto bound = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!fs::exists(state) && std::chrono::steady_clock::now() < bound &&
         ::waitpid(demo, nullptr, WNOHANG) == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const bool began = fs::exists(state);
  ::kill(demo, SIGKILL);
  ::waitpid(demo, nullptr, 0);
  ASSERT_TRUE(began) << read(folder / "log");
  // The processes of the demo end with it, which takes them a moment.
  const std::string list =
      "XDG_RUNTIME_DIR='" + (folder / "run").string() + "' \"$0\" testbed list";
  while (in_shell(list).output.find("demo-") != std::string::npos &&
         std::chrono::steady_clock::now() < bound) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_FALSE(fs::exists(state));
  EXPECT_FALSE(fs::exists(folder / "out/.testbed"));
}

}  // namespace
}  // namespace interneuron::cli::local_faults_test
