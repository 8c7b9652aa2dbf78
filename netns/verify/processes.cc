#include "netns/verify/processes.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "netns/testbed/testbed.h"
#include "node/io/file_descriptor.h"

namespace interneuron::cli::verify {

namespace {

namespace fs = std::filesystem;

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

}  // namespace

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

namespace {

pid_t spawn(const netns::State& state, netns::Host host, const std::vector<std::string>& argv,
            const fs::path& stem) {
  const io::FileDescriptor in(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  const io::FileDescriptor out = create(stem.string() + ".out");
  const io::FileDescriptor err = create(stem.string() + ".err");
  netns::SpawnOptions options;
  options.stdio = {in.get(), out.get(), err.get()};
  return netns::Testbed::spawn(state, host, argv, options);
}

}  // namespace

Process::Process(const netns::State& state, netns::Host host, const std::vector<std::string>& argv,
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

}  // namespace interneuron::cli::verify
