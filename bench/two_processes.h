// Two processes of a benchmark in two network namespaces that one veth pair joins, each on a
// processor of its own, and what each has spent of it. Needs user namespaces, or root, and `ip`.
#pragma once

#include <fmt/format.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include "netns/wiring/namespaces.h"
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

// --- the two namespaces

// This process moves to a namespace with the NIC "va"; roads[0] is the one with "vb". Nothing where
// the veth pair cannot be made; throws TestbedError where the namespaces cannot.
inline std::optional<netns::Namespaces> joined_namespaces() {
  netns::Namespaces made = netns::make_namespaces(0, 1);
  const int road = made.roads.front().get();
  if (!shell("ip link set lo up") || !shell("ip link add va type veth peer name vb") ||
      !shell(fmt::format("ip link set vb netns /proc/{}/fd/{}", ::getpid(), road)) ||
      !shell("ip addr add 10.97.0.1/24 dev va") || !shell("ip link set va up")) {
    return std::nullopt;
  }
  const netns::NetworkNamespaceScope in_road(road, made.air.get());
  if (!shell("ip link set lo up") || !shell("ip link set vb up") ||
      !shell(fmt::format("ip addr add {}/24 dev vb", kRoadAddress))) {
    return std::nullopt;
  }
  return made;
}

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
