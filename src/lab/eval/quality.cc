#include "lab/eval/quality.h"

#include <algorithm>

#include "lab/sim/offload.h"

namespace interneuron::eval {
namespace {

// AP of L4 on JPEG quality 80 of the full frame (76 kB, every tenth frame) beside L4 on raw
// (docs/constants.md, "Images and detectors"). Only L4 was measured; the others are taken to lose
// the same share.
constexpr std::size_t kJpegBytes = 76'000;
constexpr double kJpegShare = 0.391 / 0.396;

// The cost of age (docs/constants.md, "Images and detectors"): AP of a result of L4 that is 1, 2, 3
// frames old, beside a fresh one. L0 loses alike (.085, .040, .019 of .135); the other levels were
// not measured.
constexpr double kFresh = 0.396;
constexpr double kAged[] = {0.250, 0.109, 0.051};

}  // namespace

Profile default_profile(bool jpeg) {
  Profile profile;
  const sim::OffloadOptions defaults;
  profile.variants = {{"raw", defaults.variant_bytes[0]}, {"sampled", defaults.variant_bytes[1]}};
  if (jpeg) profile.variants[0] = {"jpeg", kJpegBytes};
  for (const sim::LevelRuntime& level : defaults.ladder) {
    profile.level_names.push_back(level.name);
    profile.levels.push_back({level.median, level.p95, level.quality});
    if (jpeg) profile.levels.back().quality[0] *= kJpegShare;
  }
  profile.fallback.local = defaults.ladder.front().quality[0];
  for (const double aged : kAged) profile.fallback.stale_share.push_back(aged / kFresh);
  return profile;
}

double remote_quality(const Profile& profile, std::size_t level, std::size_t variant) {
  const std::vector<double>& quality = profile.levels.at(level).quality;
  return quality.empty() ? 0 : quality[std::min(variant, quality.size() - 1)];
}

double quality_of(const Profile& profile, const Shown& shown) {
  switch (shown.kind) {
    case Shown::Kind::kRemote:
      return remote_quality(profile, shown.level, shown.variant);
    case Shown::Kind::kLocal:
      return profile.fallback.local;
    case Shown::Kind::kStale: {
      const std::vector<double>& share = profile.fallback.stale_share;
      if (shown.age == 0 || shown.age > share.size()) return 0;
      return share[shown.age - 1] * remote_quality(profile, shown.level, shown.variant);
    }
    case Shown::Kind::kNothing:
      break;
  }
  return 0;
}

}  // namespace interneuron::eval
