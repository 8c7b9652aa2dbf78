// The two nodes of `nature_bench`, each a process of its own in one host of the testbed, and the
// file by which the vehicle tells what it believes. Errors: Failure, TestbedError. The functions
// fork, so call them before other threads start.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "interneuron/link.h"
#include "netns/state/state.h"

namespace interneuron::bench {

// Under load the vehicle sends ten messages of this size a second over every link: 8 Mbit/s, half
// of what the narrowest step (15 Mbit/s) carries, so that the load itself makes no lasting queue.
inline constexpr std::size_t kMessageBytes = 96 * 1024;

// Both nodes run until SIGTERM; the caller waits for their end. The roadside unit answers every
// message with a result of one byte.
pid_t start_road(const netns::State& state);
// Every 20 ms the vehicle writes its estimates to `file`, one CSV line per link: t_ns
// (CLOCK_MONOTONIC), link, rtt_p50_ms, loss, rate_mbit, four scores; and a line for each change of
// a path's state: t_ns, link, "path", state. Unless `pcap` is empty it also writes a capture of
// that name (include/interneuron/pcap_tap.h).
pid_t start_vehicle(const netns::State& state, bool loaded, const std::filesystem::path& file,
                    const std::string& pcap);

// A line of the file: the estimates of one link at one instant.
struct Line {
  TimePoint at{};
  std::size_t link = 0;
  double rtt_ms = 0;
  double loss = 0;
  double rate_mbit = 0;
  Nature nature{};
};
// A line of the file: a path has changed to this state.
struct PathLine {
  TimePoint at{};
  std::size_t link = 0;
  PathState to{};
};
struct Lines {
  std::vector<Line> beliefs;
  std::vector<PathLine> paths;
};
// Lines that are neither are skipped, as the last one may be cut off. Throws Failure when the file
// cannot be read.
Lines read_lines(const std::filesystem::path& file);

}  // namespace interneuron::bench
