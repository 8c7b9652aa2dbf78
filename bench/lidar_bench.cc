// How well and how fast each level finds clusters on each rung of the ladder of voxel sizes, and
// what age leaves of a result: the program whose tables the lidar profile of the evaluation comes
// from (docs/constants.md, "Point clouds and clusters").
//
//   lidar_bench SWEEP [--seed N] [--sweeps N]
//
// SWEEP is KITTI's .bin or nuScenes' .pcd.bin (scripts/fetch_data.sh --point-clouds), moved by a
// synthetic ego-motion (src/app/perception/point_cloud.h). Agreement is that with what the best
// level finds on the whole sweep, so of that combination it is 1. Times are of the processor, of
// one thread.
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "app/perception/clusters.h"
#include "app/perception/point_cloud.h"

namespace interneuron::perception {
namespace {

// The ages of a result that are measured, in sweeps.
constexpr std::uint32_t kAges = 4;

double cpu_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) / 1e6;
}

double at_share(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// What the best level finds on the whole of each sweep.
using Reference = std::vector<std::vector<Cluster>>;

struct Measured {
  std::vector<double> times_ms;
  // By age of the result.
  std::vector<double> agreement[kAges];
};

Measured measure(const std::vector<Bytes>& messages, const ClusterLevel& level,
                 const Reference& reference) {
  Measured out;
  const std::size_t sweeps = messages.size();
  for (std::size_t i = 0; i < sweeps; ++i) {
    const double start = cpu_ms();
    const Points points = decode_cloud(messages[i])->points;
    const std::vector<Cluster> found = find_clusters(points, level);
    out.times_ms.push_back(cpu_ms() - start);
    for (std::uint32_t age = 0; age < kAges && i + age < sweeps; ++age) {
      out.agreement[age].push_back(agreement(found, reference[i + age]));
    }
  }
  return out;
}

void run(const std::string& file, std::uint64_t seed, std::uint32_t sweeps) {
  const MovedSweeps drive(read_cloud(file), seed);
  const auto rungs = cloud_rungs();
  const auto levels = cluster_levels();
  std::vector<std::vector<Bytes>> messages(rungs.size());
  std::vector<double> encode_ms;
  Reference reference;
  std::size_t clusters = 0;
  for (std::uint32_t i = 0; i < sweeps; ++i) {
    const Points points = drive.sweep(i);
    const double start = cpu_ms();
    std::vector<Bytes> variants = encode_cloud_ladder(points, i);
    encode_ms.push_back(cpu_ms() - start);
    for (std::size_t r = 0; r < rungs.size(); ++r) messages[r].push_back(std::move(variants[r]));
    reference.push_back(find_clusters(points, levels.back()));
    clusters += reference.back().size();
  }
  std::printf(
      "%s: %u sweeps, seed %llu, %.1f clusters a sweep; encoding all variants %.2f ms, p95 %.2f "
      "ms\n",
      file.c_str(), sweeps, static_cast<unsigned long long>(seed),
      static_cast<double>(clusters) / sweeps, at_share(encode_ms, 0.5), at_share(encode_ms, 0.95));
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    double bytes = 0;
    for (const Bytes& message : messages[r]) bytes += static_cast<double>(message.size()) / sweeps;
    for (const ClusterLevel& level : levels) {
      const Measured m = measure(messages[r], level, reference);
      std::printf("%-6s %8.0f B  %-16s median %5.1f ms p95 %5.1f ms  agreement %.3f; when old:",
                  rungs[r].name, bytes, level.name.c_str(), at_share(m.times_ms, 0.5),
                  at_share(m.times_ms, 0.95), mean(m.agreement[0]));
      for (std::uint32_t age = 1; age < kAges; ++age) std::printf(" %.3f", mean(m.agreement[age]));
      std::printf("\n");
      std::fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace interneuron::perception

int main(int argc, char** argv) {
  CLI::App app("Agreement and run time of each level on each rung of the ladder of voxel sizes");
  std::string sweep;
  std::uint64_t seed = 1;
  std::uint32_t sweeps = interneuron::perception::kLapSweeps;
  app.add_option("SWEEP", sweep, "KITTI .bin or nuScenes .pcd.bin")->required();
  app.add_option("--seed", seed, "Of the synthetic motion");
  app.add_option("--sweeps", sweeps, "Only so many")->check(CLI::Range(4U, sweeps));
  CLI11_PARSE(app, argc, argv);
  try {
    interneuron::perception::run(sweep, seed, sweeps);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lidar_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}
