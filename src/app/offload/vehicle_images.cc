#include "app/offload/vehicle_run.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "app/offload/offload_request.h"
#include "node/io/steady_clock.h"

namespace interneuron::offload {
namespace {

namespace perc = perception;

// The demo video's frames.
const cv::Size kFrame(768, 576);
// Noise of so many pixels and this contrast, made as large as a frame, is about as many bytes as a
// frame of the demo video in each JPEG: 47, 25, 14 and 10 kB (docs/constants.md, "Images and
// detectors").
const cv::Size kCoarse(192, 144);
constexpr int kDarkest = 96;
constexpr int kBrightest = 160;

Variants with_requests(const std::vector<Bytes>& images, Duration budget) {
  Variants out;
  for (const Bytes& image : images) out.push_back(with_request(budget, image));
  return out;
}

}  // namespace

Variants encoded(const Camera::Shot& shot, perc::Images images, Duration budget) {
  if (images == perc::Images::kJpeg) {
    const auto index = static_cast<std::uint32_t>(shot.frame.index);
    return with_requests(perc::encode_variants(shot.frame.bgr, index, perc::variants_of(images)),
                         budget);
  }
  perc::Image sampled = shot.raw;
  sampled.variant = perc::Variant::kSampled;
  sampled.bgr = perc::every_second_pixel(shot.raw.bgr);
  return with_requests({perc::encode_image(shot.raw), perc::encode_image(sampled)}, budget);
}

Encoding encoding_of(perc::Images images) {
  constexpr int kRuns = 5;
  cv::Mat coarse(kCoarse, CV_8UC3);
  cv::RNG(1).fill(coarse, cv::RNG::UNIFORM, kDarkest, kBrightest);
  cv::Mat noise;
  cv::resize(coarse, noise, kFrame, 0, 0, cv::INTER_CUBIC);
  Encoding out;
  for (int i = 0; i < kRuns; ++i) {
    const TimePoint start = io::now();
    const auto variants = perc::encode_variants(noise, 0, perc::variants_of(images));
    out.time = std::max(out.time, io::now() - start);
    out.bytes = variants.front().size();
  }
  return out;
}

perc::Ladder local_ladder(const VehicleOptions& options,
                          const std::optional<std::filesystem::path>& data, std::size_t levels) {
  return perc::make_ladder({.kind = *perc::parse_ladder_kind(options.ladder),
                            .data_dir = data.value_or(std::filesystem::path()),
                            .budget = ladder_budget(from_ms(options.deadline_ms)),
                            .max_levels = levels,
                            .spend = {}});
}

std::vector<LevelProfile> believed_levels(const perc::Ladder& ladder, perc::Images images) {
  std::vector<LevelProfile> out;
  for (std::size_t i = 0; i < ladder.size(); ++i) {
    const perc::Level& level = ladder.level(i);
    const Duration median = std::max(level.r_median, level.recorded_median);
    if (level.quality_on(images).empty() || median <= Duration::zero()) return {};
    out.push_back({median, std::max(median, level.r_p95), level.quality_on(images)});
  }
  return out;
}

}  // namespace interneuron::offload
