#include "app/offload/road.h"

#include <spdlog/spdlog.h>

#include "app/offload/offload_request.h"
#include "app/perception/frame_source.h"
#include "app/settings/data.h"

namespace interneuron::offload {
namespace {

namespace perc = perception;

// Three seconds of a camera at 10 Hz, in which the background models settle.
constexpr std::size_t kPictures = 30;
// Between two runs, since images of a camera do not follow each other at once either: without it
// the caches would be warmer than in operation.
constexpr Duration kPause = std::chrono::milliseconds(40);

std::vector<perc::Image> pictures_of(const RoadOptions& options,
                                     const std::optional<std::filesystem::path>& data) {
  perc::FrameSource source(options.video.empty() ? settings::default_video(data) : options.video);
  std::vector<perc::Image> pictures;
  while (pictures.size() < kPictures) {
    const auto frame = source.next();
    if (!frame) break;
    pictures.push_back(perc::make_variant(frame->bgr, static_cast<std::uint32_t>(frame->index),
                                          perc::Variant::kRaw));
  }
  return pictures;
}

}  // namespace

std::optional<perc::Ladder> road_ladder(const RoadOptions& options,
                                        const std::optional<std::filesystem::path>& data) {
  if (options.ladder == kNoLadder) return std::nullopt;
  return perc::make_ladder({.kind = *perc::parse_ladder_kind(options.ladder),
                            .data_dir = data.value_or(std::filesystem::path()),
                            .budget = ladder_budget(from_ms(options.deadline_ms)),
                            .max_levels = 0,
                            .spend = {}});
}

std::vector<LevelProfile> calibrated(perc::Ladder& ladder, const RoadOptions& options,
                                     const std::optional<std::filesystem::path>& data) {
  const auto pictures = pictures_of(options, data);
  spdlog::info("detectors: {}; calibrating on {} pictures, {} runs per level", ladder.title(),
               pictures.size(), options.calibration_runs);
  ladder.calibrate(
      pictures, options.calibration_runs,
      [](const perc::Level& level, std::size_t done, std::size_t total) {
        spdlog::info("level {} of {}: {}: median {:.1f} ms, p95 {:.1f} ms", done, total, level.name,
                     to_ms(level.r_median), to_ms(level.r_p95));
      },
      kPause);
  std::vector<LevelProfile> levels;
  for (std::size_t i = 0; i < ladder.size(); ++i) {
    const perc::Level& level = ladder.level(i);
    levels.push_back({level.r_median, level.r_p95, level.quality});
  }
  return levels;
}

}  // namespace interneuron::offload
