#include "app/load_testbed/programs.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "app/load_testbed/ends.h"
#include "app/offload/road_child.h"
#include "host/io/steady_clock.h"
#include "host/process/failure.h"
#include "host/process/signals.h"
#include "netns/testbed/testbed.h"

namespace interneuron::cli {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// From when everybody has met until messages begin: links are measured meanwhile, as in virtual
// time.
constexpr Duration kWarmUp = 2s;
// For a program to be ready. No measurement behind this value: 200 vehicles need a few seconds.
constexpr Duration kPatience = 60s;
constexpr int kLookMs = 100;

void tell(const std::string& line) {
  std::puts(line.c_str());
  std::fflush(stdout);
}

bool is_ours(load::Peer peer) {
  return peer == load::Peer::kOurs || peer == load::Peer::kOursVariants;
}

void play_vehicles(const Order& order) {
  const Begin ready = [] {
    const TimePoint begin = io::now() + kWarmUp;
    tell("ready " + std::to_string(begin.time_since_epoch().count()));
    return begin;
  };
  const load::Peer peer = order.scenario.peer;
  const auto send = is_ours(peer) ? send_ours : peer == load::Peer::kUdp ? send_udp : send_tcp;
  write_record(order, send(order, ready));
}

void play_road(const Order& order) {
  const load::Peer peer = order.scenario.peer;
  const auto receive = is_ours(peer)              ? receive_ours
                       : peer == load::Peer::kUdp ? receive_udp
                                                  : receive_tcp;
  Reception reception;
  receive(
      order, [] { tell("ready"); }, reception);
  write_record(order, RoadRecord{reception.arrivals(), reception.cpu()});
}

int open_log(const fs::path& file) {
  const int fd = ::open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
  if (fd < 0) throw Failure(kFailed, "'" + file.string() + "': " + std::strerror(errno));
  return fd;
}

// Starts the program; its stdout can be read from `out` afterwards.
pid_t start(const netns::State& state, netns::Host host, const std::vector<std::string>& argv,
            const fs::path& log, io::FileDescriptor& out) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw Failure(kFailed, std::string("pipe: ") + std::strerror(errno));
  }
  out = io::FileDescriptor(ends[0]);
  const io::FileDescriptor in(ends[1]);
  const io::FileDescriptor errors(open_log(log));
  netns::SpawnOptions spawn;
  spawn.stdio = {-1, in.get(), errors.get()};
  return netns::Testbed::spawn(state, host, argv, spawn);
}

}  // namespace

int run_load_end(const fs::path& file, const std::string& end) {
  const Order order = read_order(file);
  // Interneuron's roadside unit ends by its own watch of signals, which a second one would shadow.
  const SignalWatch signals;
  (end == kVehiclesEnd ? play_vehicles : play_road)(order);
  return kFine;
}

LoadProgram::LoadProgram(const netns::State& state, netns::Host host, const fs::path& order,
                         const std::string& end)
    : end_(end),
      log_(order.parent_path() / (end + ".log")),
      child_(start(state, host,
                   {own_program(), "bench", "load", "--order", order.string(), "--end", end}, log_,
                   stdout_)) {}

std::string LoadProgram::await_ready() {
  std::string said;
  const TimePoint patience = io::now() + kPatience;
  while (io::now() < patience) {
    SignalWatch::check();
    pollfd readable{stdout_.get(), POLLIN, 0};
    if (::poll(&readable, 1, kLookMs) <= 0) continue;
    std::array<char, 256> chunk;
    const ssize_t size = ::read(stdout_.get(), chunk.data(), chunk.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) {
      judge(child_.wait());
      throw Failure(kFailed, "the " + end_ + " of a run ended before they were ready");
    }
    said.append(chunk.data(), static_cast<std::size_t>(size));
    const std::size_t line = said.find('\n');
    if (line == std::string::npos) continue;
    constexpr std::string_view kReady = "ready ";
    return line > kReady.size() ? said.substr(kReady.size(), line - kReady.size()) : "";
  }
  throw Failure(kFailed, "the " + end_ + " of a run were not ready in time: " + last_words());
}

void LoadProgram::finish() { judge(child_.wait()); }

void LoadProgram::end() { judge(child_.end()); }

// A terminal's Ctrl-C reaches the program as it reaches us, and may reach it first.
void LoadProgram::judge(int code) const {
  SignalWatch::check();
  if (code == kFine) return;
  if (code == 128 + SIGINT || code == 128 + SIGTERM || code == 128 + SIGHUP) {
    throw Failure(code, "interrupted");
  }
  throw Failure(kFailed, "the " + end_ + " of a run failed: " + last_words());
}

std::string LoadProgram::last_words() const {
  std::ifstream in(log_);
  std::string last = "they said nothing";
  for (std::string line; std::getline(in, line);) last = line.empty() ? last : line;
  return last;
}

}  // namespace interneuron::cli
