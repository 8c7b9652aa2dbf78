#include "netns/verify/tools.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "netns/testbed/testbed.h"
#include "netns/verify/readings.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns::verify {

namespace {

namespace fs = std::filesystem;

// tcpdump's capture buffer. 30,000 packets a second of kCaptureBytes fill a third of it in a
// second, the longest time for which tcpdump lets packets wait.
constexpr int kCaptureBufferKib = 16 * 1024;
// Seconds between echo requests. Debian's ping allows any user 2 ms and more.
constexpr const char* kPingInterval = "0.01";
// Between a signal and SIGKILL. No measurement is behind this value: it only has to be longer than
// iperf3 needs to write its last report, which is less than a second.
constexpr Duration kGrace = std::chrono::seconds(2);
// Between two looks at a tool's output: short against the second that a tool takes to start.
constexpr Duration kNap = std::chrono::milliseconds(20);

bool on_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (::access((folder + "/" + program).c_str(), X_OK) == 0) return true;
  }
  return false;
}

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

io::FileDescriptor create(const fs::path& file) {
  io::FileDescriptor fd(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (fd.get() < 0) {
    throw process::Failure(process::kFailed,
                           fmt::format("cannot write {}: {}; set TMPDIR to a folder with space",
                                       file.string(), std::strerror(errno)));
  }
  return fd;
}

pid_t spawn(const State& state, Host host, const std::vector<std::string>& argv,
            const fs::path& stem) {
  const io::FileDescriptor in(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  const io::FileDescriptor out = create(stem.string() + ".out");
  const io::FileDescriptor err = create(stem.string() + ".err");
  SpawnOptions options{.stdio = {in.get(), out.get(), err.get()}};
  return Testbed::spawn(state, host, argv, options);
}

}  // namespace

std::uint16_t port_of(std::uint16_t first, std::size_t slot, Direction direction) {
  return static_cast<std::uint16_t>(first + 2 * slot + (direction == Direction::kDown ? 1 : 0));
}

std::vector<std::string> iperf_server(const IperfFlow& flow) {
  return {"iperf3",      "-s", "-1", "-B", flow.link.road_address, "-p", std::to_string(flow.port),
          "--forceflush"};
}

std::vector<std::string> iperf_client(const IperfFlow& flow, int seconds) {
  std::vector<std::string> argv{"iperf3",      "-u",
                                "-c",          flow.link.road_address,
                                "-B",          flow.link.vehicle_address,
                                "-p",          std::to_string(flow.port),
                                "-l",          std::to_string(flow.payload_bytes),
                                "-b",          fmt::format("{:.0f}", flow.payload_bits_per_second),
                                "-t",          std::to_string(seconds),
                                "--forceflush"};
  if (flow.direction == Direction::kDown) argv.emplace_back("-R");
  return argv;
}

std::vector<std::string> tcpdump(const std::string& nic, const std::vector<std::uint16_t>& ports,
                                 bool both_ways) {
  std::string filter = "udp and (";
  for (const std::uint16_t port : ports) {
    filter += fmt::format("{}port {}", port == ports.front() ? "" : " or ", port);
  }
  // -Z root: tcpdump keeps its user instead of becoming "tcpdump", which may not exist inside the
  // testbed's user namespace. It writes nothing but its stdout.
  return {"tcpdump",
          "-n",
          "-p",
          "-i",
          nic,
          "-s",
          std::to_string(kCaptureBytes),
          "-B",
          std::to_string(kCaptureBufferKib),
          "-Q",
          both_ways ? "inout" : "in",
          "-Z",
          "root",
          "-w",
          "-",
          filter + ")"};
}

std::vector<std::string> ping(const TestbedLink& link) {
  return {"ping", "-n", "-D", "-i", kPingInterval, "-I", link.vehicle_address, link.road_address};
}

std::vector<std::string> two_pings(const TestbedLink& link, Direction direction) {
  const bool up = direction == Direction::kUp;
  return {"ping",
          "-n",
          "-D",
          "-i",
          "1",
          "-c",
          "2",
          "-I",
          up ? link.vehicle_address : link.road_address,
          up ? link.road_address : link.vehicle_address};
}

Host vehicle_of(const TestbedLink& link) { return {Host::Kind::kVehicle, link.vehicle}; }

Host receiver_of(const TestbedLink& link, Direction direction) {
  return direction == Direction::kUp ? kRoad : vehicle_of(link);
}

void require_tools(std::initializer_list<Tool> tools) {
  std::string programs;
  std::string packages;
  for (const Tool& tool : tools) {
    if (on_path(tool.program)) continue;
    programs += (programs.empty() ? "" : ", ") + std::string(tool.program);
    packages += std::string(" ") + tool.package;
  }
  if (programs.empty()) return;
  throw process::Failure(process::kCannotHere,
                         fmt::format("verify needs {}; `apt-get install{}` installs what is "
                                     "missing",
                                     programs, packages));
}

void allow_setgroups() {
#if defined(__x86_64__)
  constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
  constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
  return;
#endif
  std::array<sock_filter, 6> code{{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 0, 2),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_setgroups, 1, 0),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
      // Without an error number in the lower bits the call returns 0, which is success.
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO),
  }};
  const sock_fprog program{code.size(), code.data()};
  // The kernel accepts a filter only from a process without new privileges. Should it refuse either
  // call, tcpdump does not start and its own message becomes the error.
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1UL, 0UL, 0UL, 0UL) == 0) {
    ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program);
  }
}

Process::Process(const State& state, Host host, const std::vector<std::string>& argv,
                 const process::PrivateFolder& folder, const std::string& name)
    : stem_(folder / name), child_(spawn(state, host, argv, stem_)) {}

void Process::end(int signal) { child_.end(signal, kGrace); }

std::string Process::output() const { return content(stem_.string() + ".out"); }

std::string Process::errors() const { return content(stem_.string() + ".err"); }

std::string Process::last_words() const {
  std::string last;
  for (const std::string& text : {output(), errors()}) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (!line.empty()) last = line;
    }
  }
  return last;
}

bool await_text(const Process& process, const std::string& text, Duration bound) {
  for (; bound > Duration{}; bound -= kNap) {
    if (process.errors().find(text) != std::string::npos ||
        process.output().find(text) != std::string::npos) {
      return true;
    }
    process::SignalWatch::sleep(kNap);
  }
  return false;
}

}  // namespace interneuron::netns::verify
