// The demo as a user runs it, short, with the ladder that needs no models.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>

#include <cctype>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <tuple>

#include "app/perception/codec.h"
#include "app/records/run_files.h"
#include "tests/app/cli/beside.h"
#include "tests/app/cli/support.h"

namespace interneuron::cli::demo_test {
namespace {

// A folder of small pictures with something that moves, so that no video is needed.
void make_pictures(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  constexpr int kWidth = 192;
  constexpr int kHeight = 144;
  for (int i = 0; i < 30; ++i) {
    std::ofstream out(folder / ("f" + std::to_string(100 + i) + ".ppm"), std::ios::binary);
    out << "P6\n" << kWidth << ' ' << kHeight << "\n255\n";
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool person = x >= 5 * i && x < 5 * i + 12 && y >= 60 && y < 92;
        const char v = static_cast<char>(person ? 230 : 60 + (x + y) % 8);
        out.put(v).put(v).put(v);
      }
    }
  }
}

// Processes of a group that still run. Those that ended and wait for init to reap them do not
// count: the leak sanitizer leaves one.
int running_in_group(pid_t group) {
  int running = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    if (std::isdigit(static_cast<unsigned char>(entry.path().filename().native()[0])) == 0)
      continue;
    std::ifstream in(entry.path() / "stat");
    const std::string text(std::istreambuf_iterator<char>(in), {});
    // "PID (NAME) STATE PARENT GROUP …"
    char state = 'Z';
    int its_group = 0;
    const std::size_t name_end = text.rfind(')');
    if (name_end == std::string::npos) continue;
    if (std::sscanf(text.c_str() + name_end + 1, " %c %*d %d", &state, &its_group) != 2) continue;
    running += its_group == group && state != 'Z' ? 1 : 0;
  }
  return running;
}

// The first child of a process that has this name (/proc/PID/comm); 0: there is none.
pid_t child_named(pid_t parent, const std::string& name) {
  const std::string number = std::to_string(parent);
  std::ifstream children("/proc/" + number + "/task/" + number + "/children");
  for (pid_t child = 0; children >> child;) {
    std::ifstream comm("/proc/" + std::to_string(child) + "/comm");
    std::string found;
    std::getline(comm, found);
    if (found == name) return child;
  }
  return 0;
}

class Demo : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = no_testbed();
    if (!why.empty()) GTEST_SKIP() << why;
    make_pictures(folder_ / "pictures");
  }
  std::string arguments(int rounds) const {
    // How long the detectors take is not what is tested: they are measured in a fifth of the time.
    return "demo --ladder motion --calibration-runs 8 --rounds " + std::to_string(rounds) +
           " --video '" + (folder_ / "pictures").string() + "' --out '" +
           (folder_ / "out").string() + "'";
  }
  bool wrote(const std::string& file) const {
    return std::filesystem::exists(folder_ / "out" / file);
  }
  void interrupt(const std::string& when);
  TempFolder folder_;
};

// Starts the demo in a process group of its own, as a terminal does, and sends that Ctrl-C when its
// log says `when`. Expects exit code 130, and that no process and no namespace is left.
void Demo::interrupt(const std::string& when) {
  const std::filesystem::path log = folder_ / "log";
  std::filesystem::remove(log);
  const pid_t pid = ::fork();
  ASSERT_GE(pid, 0);
  if (pid == 0) {
    ::setpgid(0, 0);
    const int fd = ::open(log.c_str(), O_CREAT | O_WRONLY, 0600);
    ::dup2(fd, 1);
    ::dup2(fd, 2);
    const std::string command = "exec '" + places::program() + "' " + arguments(1000);
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  const auto contents = [&log] {
    std::ifstream in(log);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (contents().find(when) == std::string::npos &&
         std::chrono::steady_clock::now() < deadline) {
    ::poll(nullptr, 0, 20);
  }
  EXPECT_NE(contents().find(when), std::string::npos) << contents();
  const pid_t holder = child_named(pid, "interneuron-emu");
  EXPECT_NE(holder, 0) << "no process holds the testbed";
  ::kill(-pid, SIGINT);
  int status = 0;
  ASSERT_EQ(::waitpid(pid, &status, 0), pid);
  ASSERT_TRUE(WIFEXITED(status)) << contents();
  EXPECT_EQ(WEXITSTATUS(status), 130) << contents();
  EXPECT_EQ(running_in_group(pid), 0) << "a process of the demo is still there";
  EXPECT_FALSE(std::filesystem::exists("/proc/" + std::to_string(holder)))
      << "the holder is still there, and with it the namespaces";
  EXPECT_FALSE(wrote(".testbed"));
}

TEST_F(Demo, AnswersEveryRoundAndItsFilesAgree) {
  // Where the keys of the run are, as long as it lasts.
  const std::filesystem::path scratch = folder_ / "scratch";
  std::filesystem::create_directory(scratch);
  const Ran ran = run_program(
      "env", "TMPDIR='" + scratch.string() + "' '" + places::program() + "' " + arguments(20));
  ASSERT_EQ(ran.code, 0) << ran.output;
  EXPECT_NE(ran.output.find("packets are encrypted"), std::string::npos) << ran.output;
  EXPECT_TRUE(std::filesystem::is_empty(scratch)) << "the keys are still there";
  for (const char* file : {"rounds.csv", "summary.json", "latency.png"}) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / file)) << file;
  }
  const records::Json s = records::read_json(folder_ / "out" / "summary.json");
  EXPECT_EQ(s["rounds"], 20);
  EXPECT_EQ(s["answers"], 20);
  EXPECT_EQ(s["on_time"].get<int>() + s["local"].get<int>(), 20);
  // Recomputed from the CSV by other means than the program's.
  const auto rows = records::read_csv(folder_ / "out" / "rounds.csv");
  int on_time = 0;
  double sum = 0;
  for (const records::RoundRow& r : rows) {
    if (r.outcome != Outcome::kRemote) continue;
    ++on_time;
    sum += to_ms(r.e2e);
  }
  EXPECT_EQ(s["on_time"], on_time);
  EXPECT_EQ(s["timeouts"], 20 - on_time);
  if (on_time > 0) {
    EXPECT_NEAR(s["e2e_ms"]["mean"].get<double>(), sum / on_time, 0.001);
  }
}

TEST_F(Demo, JsonIsAllThatStdoutHolds) {
  const Ran ran = run(arguments(5) + " --json", false);
  ASSERT_EQ(ran.code, 0) << ran.output;
  const records::Json s = records::Json::parse(ran.output, nullptr, false);
  ASSERT_FALSE(s.is_discarded()) << ran.output;
  EXPECT_EQ(s["schema"], "interneuron.run/1");
}

TEST_F(Demo, ObeysTheGuardThatIsAskedFor) {
  const Ran ran = run(arguments(10) + " --guard paper");
  ASSERT_EQ(ran.code, 0) << ran.output;
  EXPECT_EQ(records::read_json(folder_ / "out" / "summary.json")["guard"], "paper");
  EXPECT_EQ(records::read_csv(folder_ / "out" / "rounds.csv").front().guard, "paper");
}

TEST_F(Demo, SendsTheImagesThatAreAskedForAndNamesThem) {
  for (const auto& [option, images, policy] :
       {std::tuple{"", "jpeg", "joint"}, std::tuple{" --images paper", "paper", "down_sampling"}}) {
    const Ran ran = run(arguments(10) + option);
    ASSERT_EQ(ran.code, 0) << ran.output;
    const records::Json s = records::read_json(folder_ / "out" / "summary.json");
    EXPECT_EQ(s["images"], images);
    EXPECT_EQ(s["policy"], policy);
    const auto is_known = [&](const std::string& name) {
      const auto variant = perception::parse_variant(name);
      return name == "local" || (variant && to_string(perception::images_of(*variant)) == images);
    };
    for (const auto& [name, count] : s["used"].items()) EXPECT_TRUE(is_known(name)) << name;
    for (const records::RoundRow& row : records::read_csv(folder_ / "out" / "rounds.csv")) {
      EXPECT_TRUE(!row.road || is_known(row.road->variant)) << row.road->variant;
      EXPECT_TRUE(row.plan.empty() || is_known(row.plan.substr(0, row.plan.find(':')))) << row.plan;
    }
  }
}

// No network here is trusted, but its packets are encrypted.
TEST_F(Demo, ThePolicySecureIsContentWithEncryption) {
  const Ran ran = run(arguments(5) + " --policy secure");
  ASSERT_EQ(ran.code, 0) << ran.output;
  EXPECT_EQ(ran.output.find("nothing is sent: no link"), std::string::npos) << ran.output;
  EXPECT_EQ(records::read_json(folder_ / "out" / "summary.json")["refused"], 0);
}

TEST_F(Demo, AVehicleInTheClearTellsOnceWhatThePolicyRefusesAndAnswersLocally) {
  const std::string pictures = "--ladder motion --video '" + (folder_ / "pictures").string() + "'";
  const Beside road("'" + places::program() +
                    "' road --insecure --nic lo --port 0 --calibration-runs 1 " + pictures);
  ASSERT_TRUE(road.ready());
  const Ran ran = run("vehicle --insecure --link lo=127.0.0.1:" + road.port() + " --rounds 5 " +
                      pictures + " --policy secure --out '" + (folder_ / "out").string() + "'");
  ASSERT_EQ(ran.code, 0) << ran.output;
  const std::size_t first = ran.output.find("nothing is sent: no link");
  EXPECT_NE(first, std::string::npos) << ran.output;
  EXPECT_EQ(ran.output.find("nothing is sent: no link", first + 1), std::string::npos);
  const records::Json s = records::read_json(folder_ / "out" / "summary.json");
  EXPECT_EQ(s["refused"], 5);
  EXPECT_EQ(s["local"], 5);
}

TEST_F(Demo, AMissedObjectiveHasItsExitCode) {
  EXPECT_THAT(run(arguments(3) + " --deadline-ms 1 --objective 99"),
              EndsSaying(4, "interneuron: objective missed: "));
}

TEST_F(Demo, EndsWithAVerdictAndSaysWhoseLineItIs) {
  const Ran ran = run(arguments(5));
  ASSERT_EQ(ran.code, 0) << ran.output;
  const records::Json s = records::read_json(folder_ / "out" / "summary.json");
  const std::string verdict = std::to_string(s["on_time"].get<int>()) +
                              " of 5 rounds answered by the roadside unit within 130 ms";
  EXPECT_NE(ran.output.find("\n" + verdict), std::string::npos) << ran.output;
  std::istringstream lines(ran.output);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 160U) << line;
    // Log lines begin with the time of day.
    if (line.size() < 3 || std::isdigit(static_cast<unsigned char>(line[0])) == 0 ||
        line[2] != ':') {
      continue;
    }
    const bool named = line.find(" vehicle: ") != std::string::npos ||
                       line.find(" road: ") != std::string::npos ||
                       line.find(" demo: ") != std::string::npos;
    EXPECT_TRUE(named) << line;
  }
}

TEST_F(Demo, InterruptedItLeavesNothingBehind) {
  interrupt("on time");
  // The rounds so far are reported all the same.
  EXPECT_TRUE(wrote("summary.json"));
}

TEST_F(Demo, InterruptedBeforeTheFirstRoundItWritesNothing) {
  for (const char* when : {"demo: testbed", "road: detectors", "road: level 1", "vehicle: local"}) {
    interrupt(when);
    for (const char* file : {"rounds.csv", "summary.json", "latency.png", "frame.png"}) {
      EXPECT_FALSE(wrote(file)) << file << ", interrupted at " << when;
    }
  }
}

// At the start of the rounds there may be one or none: there is a picture if there is a round.
TEST_F(Demo, InterruptedAtTheFirstRoundItDrawsNoEmptyPicture) {
  interrupt("for the computation");
  const bool any =
      wrote("rounds.csv") && !records::read_csv(folder_ / "out" / "rounds.csv").empty();
  EXPECT_EQ(wrote("rounds.csv"), any);
  EXPECT_TRUE(any || !wrote("latency.png"));
}

}  // namespace
}  // namespace interneuron::cli::demo_test
