// The program `nature_bench`: the two nodes, each a process of its own in one host of the testbed.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "interneuron/link.h"
#include "netns/state/state.h"

namespace interneuron::cli::bench {

// Under load: 10 messages a second of this size over every link; chosen: about 8 Mbit/s, which the
// narrowest step (15 Mbit/s) carries.
inline constexpr std::size_t kMessageBytes = 96 * 1024;

// Both run until SIGTERM; the caller reaps them. The roadside unit answers every message with a
// small result.
pid_t start_road(const netns::State& state);
// The vehicle writes what it believes of its links to `file` every 20 ms, one CSV line per link:
// t_ns (CLOCK_MONOTONIC), link, rtt_p50_ms, loss, rate_mbit, four scores; and each change of a
// path's state: t_ns, link, path, state.
// With a name of a capture it writes that too (host/io/pcap_tap.h).
pid_t start_vehicle(const netns::State& state, bool loaded, const std::filesystem::path& file,
                    const std::string& pcap);

// Of one link at one instant.
struct Line {
  TimePoint at{};
  std::size_t link = 0;
  double rtt_ms = 0;
  double loss = 0;
  double rate_mbit = 0;
  Nature nature{};
};
struct PathLine {
  TimePoint at{};
  std::size_t link = 0;
  PathState to{};
};
struct Lines {
  std::vector<Line> beliefs;
  std::vector<PathLine> paths;
};
Lines read_lines(const std::filesystem::path& file);

}  // namespace interneuron::cli::bench
