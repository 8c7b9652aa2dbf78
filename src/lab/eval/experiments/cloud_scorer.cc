#include "lab/eval/experiments/scorer.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "app/perception/point_cloud.h"
#include "app/process/failure.h"

namespace interneuron::experiments {
namespace {

namespace fs = std::filesystem;
using eval::Shown;
using perception::kLapSweeps;

// The synthetic drive is made from it.
constexpr std::uint64_t kDriveSeed = 1;

const char* file_of(eval::LidarSweep sweep) {
  return sweep == eval::LidarSweep::kKitti ? "pointcloud/kitti_000008.bin"
                                           : "pointcloud/nuscenes_lidar_top.pcd.bin";
}

}  // namespace

CloudScorer::CloudScorer(const std::optional<fs::path>& data, eval::LidarSweep sweep,
                         std::uint32_t rounds, process::Progress& progress)
    : variants_(perception::cloud_rungs().size()), levels_(perception::cluster_levels().size()) {
  const fs::path file = data.value_or(fs::path()) / file_of(sweep);
  if (!data || !fs::exists(file)) {
    missing_ = fmt::format(
        "no {}; fetch the data with scripts/fetch_data.sh --point-clouds or name them with --data",
        file_of(sweep));
    return;
  }
  try {
    const perception::MovedSweeps drive(perception::read_cloud(file), kDriveSeed);
    const std::uint32_t sweeps = std::min(rounds, kLapSweeps);
    found_.resize(sweeps * variants_ * levels_);
    progress.for_each(fmt::format("clusters of {}", to_string(sweep)), sweeps, [&](std::size_t i) {
      const auto number = static_cast<std::uint32_t>(i);
      auto next = found_.begin() + static_cast<std::ptrdiff_t>(i * variants_ * levels_);
      for (const Bytes& message : perception::encode_cloud_ladder(drive.sweep(number), number)) {
        const perception::Cloud cloud = perception::decode_cloud(message).value();
        for (const perception::ClusterLevel& level : perception::cluster_levels()) {
          *next++ = perception::find_clusters(cloud.points, level);
        }
      }
    });
  } catch (const perception::InputError& error) {
    throw process::Failure(process::kConfiguration, error.what());
  }
}

double CloudScorer::agreement_of(std::uint32_t round, const Shown& shown) const {
  if (shown.kind == Shown::Kind::kNothing) return 0;
  const bool is_local = shown.kind == Shown::Kind::kLocal;
  // The local backup is the lowest level on the whole sweep.
  const Clusters& got = found((round - std::min(shown.age, round)) % kLapSweeps,
                              is_local ? 0 : shown.variant, is_local ? 0 : shown.level);
  return perception::agreement(got, found(round % kLapSweeps, 0, levels_ - 1));
}

std::optional<double> CloudScorer::agreement(std::span<const ShownRound> rounds) const {
  if (!missing_.empty() || rounds.empty()) return std::nullopt;
  // Seeds show the same sweeps, so the same answers come many times.
  using Key = std::tuple<std::uint32_t, Shown::Kind, std::size_t, std::uint8_t, std::uint32_t>;
  std::map<Key, double> known;
  double sum = 0;
  for (const ShownRound& r : rounds) {
    const Shown& s = r.shown;
    const auto [at, is_new] =
        known.try_emplace({r.round % kLapSweeps, s.kind, s.level, s.variant, s.age});
    if (is_new) at->second = agreement_of(r.round, s);
    sum += at->second;
  }
  return sum / static_cast<double>(rounds.size());
}

}  // namespace interneuron::experiments
