#include "netns/testbed/road_child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "netns/state/hosts.h"
#include "netns/testbed/testbed.h"

namespace interneuron::netns {
namespace {

// A busy machine calibrates the slowest ladder of detectors in half of this.
constexpr int kReadySeconds = 120;

// Why the unit ended before it was ready. A terminal's Ctrl-C reaches it as it reaches us, and may
// reach it first: then it is an interruption of ours, too, and no failure.
process::Failure early_end(process::Child& child) {
  const int code = child.wait();
  if (code == 128 + SIGINT || code == 128 + SIGTERM || code == 128 + SIGHUP) {
    return {code, "interrupted"};
  }
  return {process::kFailed, "the roadside unit ended before it was ready; its log says why"};
}

// Adds what a line of the roadside's says of its detectors; other lines say nothing of them.
void read_line(const std::string& line, RoadChild::Ladder& ladder) {
  if (line.starts_with("ladder ")) ladder.description = line.substr(7);
  if (!line.starts_with("level ")) return;
  std::size_t number = 0;
  long long median = 0;
  int at = 0;
  if (std::sscanf(line.c_str(), "level %zu %lld %n", &number, &median, &at) != 2) return;
  ladder.names.push_back(line.substr(static_cast<std::size_t>(at)));
  ladder.medians.emplace_back(median);
}

// Reads the roadside's lines until "ready".
RoadChild::Ladder await_ready(int fd, process::Child& child) {
  RoadChild::Ladder ladder;
  std::string buffer;
  for (int waited_ms = 0; waited_ms < kReadySeconds * 1000;) {
    process::SignalWatch::check();
    pollfd p{fd, POLLIN, 0};
    const int n = ::poll(&p, 1, 200);
    if (n <= 0) {
      waited_ms += 200;
      continue;
    }
    std::array<char, 4096> chunk;
    const ssize_t got = ::read(fd, chunk.data(), chunk.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw early_end(child);
    buffer.append(chunk.data(), static_cast<std::size_t>(got));
    for (std::size_t end; (end = buffer.find('\n')) != std::string::npos;
         buffer.erase(0, end + 1)) {
      const std::string line = buffer.substr(0, end);
      if (line.starts_with("ready")) return ladder;
      read_line(line, ladder);
    }
  }
  throw process::Failure(process::kFailed,
                         fmt::format("the roadside unit was not ready within {} s", kReadySeconds));
}

}  // namespace

RoadChild::RoadChild(const State& state, const std::vector<std::string>& argv, int stderr_fd) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw process::Failure(process::kFailed, std::string("pipe: ") + std::strerror(errno));
  fd_ = ends[0];
  try {
    SpawnOptions spawn{.stdio = {-1, ends[1], stderr_fd}};
    child_.emplace(Testbed::spawn(state, kRoad, argv, spawn));
    ::close(ends[1]);
    ladder_ = await_ready(fd_, *child_);
  } catch (...) {
    ::close(fd_);
    throw;
  }
}

RoadChild::~RoadChild() {
  end();
  ::close(fd_);
}

void RoadChild::end() { child_->end(); }

}  // namespace interneuron::netns
