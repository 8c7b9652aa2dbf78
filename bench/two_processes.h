// Two processes of a benchmark in two network namespaces that one veth pair joins, each on a
// processor of its own, and what each has spent of it. Needs user namespaces, or root, and `ip`.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>

#include "node/io/file_descriptor.h"

namespace interneuron::bench {

// The address of the NIC "vb".
inline constexpr const char* kRoadAddress = "10.97.0.2";

// What one process has spent.
struct Cost {
  double us = 0;
  double messages = 0;
  double faults = 0;
  // A receiver tells here the median time from send() to the message, by the clock that both read.
  double delay_us = 0;
};

struct Usage {
  double us = 0;
  double faults = 0;
};

inline Usage usage() {
  rusage r{};
  ::getrusage(RUSAGE_SELF, &r);
  const auto us = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) * 1e6 + static_cast<double>(t.tv_usec);
  };
  return {us(r.ru_utime) + us(r.ru_stime), static_cast<double>(r.ru_minflt)};
}

inline Cost cost_since(const Usage& before, std::size_t messages) {
  const Usage now = usage();
  const auto n = static_cast<double>(std::max<std::size_t>(messages, 1));
  return {(now.us - before.us) / n, static_cast<double>(messages), (now.faults - before.faults) / n,
          0};
}

inline bool shell(const std::string& command) {
  return std::system(("PATH=$PATH:/sbin:/usr/sbin; " + command + " 2>/dev/null").c_str()) == 0;
}

inline bool write_file(const char* path, const std::string& text) {
  const io::FileDescriptor file(::open(path, O_WRONLY | O_CLOEXEC));
  return ::write(file.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

// --- the two namespaces

class Namespaces {
 public:
  // This process moves to a namespace with the NIC "va"; road() names the one with "vb".
  bool make() {
    const std::string uid = std::to_string(::getuid());
    const std::string gid = std::to_string(::getgid());
    if (::getuid() == 0) {
      if (::unshare(CLONE_NEWNET) != 0) return false;
    } else {
      if (::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
      write_file("/proc/self/setgroups", "deny");
      if (!write_file("/proc/self/uid_map", "0 " + uid + " 1")) return false;
      if (!write_file("/proc/self/gid_map", "0 " + gid + " 1")) return false;
    }
    std::array<int, 2> ready{};
    if (::pipe(ready.data()) != 0) return false;
    holder_ = ::fork();
    if (holder_ == 0) {
      const char done = ::unshare(CLONE_NEWNET) == 0 ? 'y' : 'n';
      if (::write(ready[1], &done, 1) == 1) ::pause();
      ::_exit(0);
    }
    char done = 'n';
    if (::read(ready[0], &done, 1) != 1 || done != 'y') return false;
    const std::string road = "nsenter -t " + std::to_string(holder_) + " -n ip ";
    road_ = io::FileDescriptor(
        ::open(("/proc/" + std::to_string(holder_) + "/ns/net").c_str(), O_RDONLY));
    return shell("ip link set lo up") && shell("ip link add va type veth peer name vb") &&
           shell("ip link set vb netns " + std::to_string(holder_)) &&
           shell("ip addr add 10.97.0.1/24 dev va") && shell("ip link set va up") &&
           shell(road + "link set lo up") &&
           shell(road + "addr add " + kRoadAddress + "/24 dev vb") &&
           shell(road + "link set vb up");
  }
  ~Namespaces() {
    if (holder_ <= 0) return;
    ::kill(holder_, SIGKILL);
    ::waitpid(holder_, nullptr, 0);
  }
  Namespaces() = default;
  Namespaces(const Namespaces&) = delete;
  Namespaces& operator=(const Namespaces&) = delete;
  int road() const { return road_.get(); }

 private:
  pid_t holder_ = -1;
  io::FileDescriptor road_;
};

// --- processes

// A child that tells its cost through a pipe.
class Process {
 public:
  Process(int processor, int network_namespace, const std::function<Cost()>& body) {
    std::array<int, 2> ends{};
    if (::pipe(ends.data()) != 0) throw std::runtime_error("pipe failed");
    std::fflush(nullptr);
    pid_ = ::fork();
    if (pid_ == 0) {
      cpu_set_t set;
      CPU_ZERO(&set);
      CPU_SET(static_cast<std::size_t>(processor), &set);
      ::sched_setaffinity(0, sizeof set, &set);
      Cost cost;
      try {
        if (network_namespace < 0 || ::setns(network_namespace, CLONE_NEWNET) == 0) cost = body();
      } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
      }
      const bool told = ::write(ends[1], &cost, sizeof cost) == sizeof cost;
      ::_exit(told ? 0 : 1);
    }
    ::close(ends[1]);
    result_ = io::FileDescriptor(ends[0]);
  }
  // Waits for its end.
  Cost cost() {
    Cost cost;
    if (::read(result_.get(), &cost, sizeof cost) != sizeof cost) cost = {};
    ::waitpid(pid_, nullptr, 0);
    return cost;
  }

 private:
  pid_t pid_ = -1;
  io::FileDescriptor result_;
};

// What a sender and a receiver have cost.
struct Pair {
  Cost send;
  Cost receive;
};

// Runs the receiver in the namespace `road`, on a processor of its own if there are two, and 0.3 s
// later the sender in this one.
inline Pair run_pair(int road, const std::function<Cost()>& send,
                     const std::function<Cost()>& receive) {
  const long processors = ::sysconf(_SC_NPROCESSORS_ONLN);
  Process receiver(processors > 1 ? 1 : 0, road, receive);
  ::usleep(300'000);
  Process sender(0, -1, send);
  Pair pair;
  pair.send = sender.cost();
  pair.receive = receiver.cost();
  return pair;
}

}  // namespace interneuron::bench
