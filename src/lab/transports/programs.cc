#include "lab/transports/programs.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <optional>

#include "app/process/failure.h"
#include "app/process/sibling.h"
#include "app/process/signals.h"
#include "lab/transports/ends.h"
#include "lab/transports/outlay.h"
#include "netns/testbed/road_child.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// From when everybody has met until messages begin: links are measured meanwhile, as in virtual
// time.
constexpr Duration kWarmUp = 2s;
// How long before messages begin a sender goes on: enough to be on time on a busy machine.
constexpr Duration kHeadStart = 10ms;
// For a program to be ready. No measurement behind this value: 200 vehicles need a few seconds.
constexpr Duration kProgramPatience = 60s;
constexpr int kLookMs = 100;

void tell(const std::string& line) {
  std::puts(line.c_str());
  std::fflush(stdout);
}

struct Ends {
  VehiclesRecord (*send)(const Order&, const Begin&);
  void (*receive)(const Order&, const Ready&, Reception&);
};

Ends ends_of(Kind kind) {
  switch (kind) {
    case Kind::kOurs:
      return {send_ours, receive_ours};
    case Kind::kUdp:
      return {send_udp, receive_udp};
    case Kind::kTcp:
    case Kind::kMptcp:
      return {send_tcp, receive_tcp};
    case Kind::kFastDds:
      return {send_fastdds, receive_fastdds};
    case Kind::kSrt:
      return {send_srt, receive_srt};
  }
  throw process::Failure(process::kFailed, "a transport has no ends");
}

void play_vehicles(const Order& order) {
  std::optional<Outlay> outlay;
  const Begin ready = [&outlay] {
    const TimePoint begin = io::now() + kWarmUp;
    tell("ready " + std::to_string(begin.time_since_epoch().count()));
    process::SignalWatch::sleep(begin - kHeadStart - io::now());
    outlay.emplace();
    return begin;
  };
  VehiclesRecord record = ends_of(order.transport.kind).send(order, ready);
  record.cpu = outlay->cpu();
  record.wire_bytes = outlay->wire_bytes();
  write_record(order, record);
}

void play_road(const Order& order) {
  Reception reception;
  ends_of(order.transport.kind)
      .receive(
          order, [] { tell("ready"); }, reception);
  write_record(order, RoadRecord{reception.arrivals(), reception.cpu()});
}

void play_cross_road(const Order& order) {
  CrossRecord record;
  receive_cross(
      order, [] { tell("ready"); }, record);
  write_record(order, record);
}

// What plays this end.
void (*player_of(const std::string& end))(const Order&) {
  if (end == kVehiclesEnd) return play_vehicles;
  if (end == kRoadEnd) return play_road;
  return end == kCrossEnd ? send_cross : play_cross_road;
}

int open_log(const fs::path& file) {
  const int fd = ::open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
  if (fd < 0)
    throw process::Failure(process::kFailed, "'" + file.string() + "': " + std::strerror(errno));
  return fd;
}

// Starts the program; its stdout can be read from `out` afterwards.
pid_t start(const netns::State& state, netns::Host host, const std::vector<std::string>& argv,
            const fs::path& log, io::FileDescriptor& out) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw process::Failure(process::kFailed, std::string("pipe: ") + std::strerror(errno));
  }
  out = io::FileDescriptor(ends[0]);
  const io::FileDescriptor in(ends[1]);
  const io::FileDescriptor errors(open_log(log));
  netns::SpawnOptions spawn{.stdio = {-1, in.get(), errors.get()}};
  return netns::Testbed::spawn(state, host, argv, spawn);
}

}  // namespace

int play_end(const fs::path& file, const std::string& end) {
  const Order order = read_order(file);
  // Interneuron's roadside unit ends by its own watch of signals, which a second one would shadow.
  const process::SignalWatch signals;
  player_of(end)(order);
  return process::kFine;
}

EndProgram::EndProgram(const netns::State& state, netns::Host host, const fs::path& order,
                       const std::string& end)
    : end_(end),
      log_(order.parent_path() / (end + ".log")),
      child_(
          start(state, host,
                {process::own_program(), "bench", "play", "--order", order.string(), "--end", end},
                log_, stdout_)) {}

std::string EndProgram::await_ready() {
  std::string said;
  const TimePoint patience = io::now() + kProgramPatience;
  while (io::now() < patience) {
    process::SignalWatch::check();
    pollfd readable{stdout_.get(), POLLIN, 0};
    if (::poll(&readable, 1, kLookMs) <= 0) continue;
    std::array<char, 256> chunk;
    const ssize_t size = ::read(stdout_.get(), chunk.data(), chunk.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) {
      judge(child_.wait());
      throw process::Failure(process::kFailed,
                             "the " + end_ + " of a run ended before they were ready");
    }
    said.append(chunk.data(), static_cast<std::size_t>(size));
    const std::size_t line = said.find('\n');
    if (line == std::string::npos) continue;
    constexpr std::string_view kReady = "ready ";
    return line > kReady.size() ? said.substr(kReady.size(), line - kReady.size()) : "";
  }
  throw process::Failure(process::kFailed,
                         "the " + end_ + " of a run were not ready in time: " + last_words());
}

void EndProgram::finish() { judge(child_.wait()); }

void EndProgram::end() { judge(child_.end()); }

// A terminal's Ctrl-C reaches the program as it reaches us, and may reach it first.
void EndProgram::judge(int code) const {
  process::SignalWatch::check();
  if (code == process::kFine) return;
  if (code == 128 + SIGINT || code == 128 + SIGTERM || code == 128 + SIGHUP) {
    throw process::Failure(code, "interrupted");
  }
  // What it lacks is its own to say, with the remedy: only there is it known what a Node needs.
  if (code == process::kPrivilege) throw process::Failure(process::kPrivilege, last_words());
  throw process::Failure(process::kFailed, "the " + end_ + " of a run failed: " + last_words());
}

std::string EndProgram::last_words() const {
  std::ifstream in(log_);
  std::string last = "they said nothing";
  for (std::string line; std::getline(in, line);) last = line.empty() ? last : line;
  constexpr std::string_view kName = "interneuron: ";
  return last.starts_with(kName) ? last.substr(kName.size()) : last;
}

}  // namespace interneuron::transports
