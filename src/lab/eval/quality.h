// What answers are worth: the accuracy of each level on each variant (profile.csv of the data) and
// what age leaves of it (docs/constants.md, "Images and detectors"). Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "interneuron/guard.h"
#include "interneuron/time.h"

namespace interneuron::eval {

// Names a variant of the frame as the profile does: bytes of the message, and per level its AP.
struct VariantProfile {
  // "raw", "sampled" or "jpeg"; of a point cloud as perception::cloud_rungs() names it.
  std::string name;
  std::size_t bytes = 0;
};

struct Profile {
  // The best one first, as they are submitted.
  std::vector<VariantProfile> variants;
  // The one that stands for the paper's sampled image, which has a quarter of the bytes of its raw
  // one.
  std::uint8_t sampled = 1;
  std::vector<std::string> level_names;
  // Each with its quality by variant.
  std::vector<LevelProfile> levels;
  // The local backup is level 0 on the best variant.
  FallbackQuality fallback;
};

// The three-level ladder on raw 484x361 and sampled 242x181 RGB (512 and 128 KB with the image
// header), as measured on the whole demo video; with `jpeg`, raw is replaced by a JPEG of quality
// 80 of the full frame (76 KB, nearly as accurate).
Profile default_profile(bool jpeg = false);

// What the application really got in one round.
struct Shown {
  enum class Kind : std::uint8_t { kNothing, kRemote, kLocal, kStale } kind = Kind::kNothing;
  // Those of the remote result, which may be an old one.
  std::size_t level = 0;
  std::uint8_t variant = 0;
  // In rounds; 0 unless kStale. A result older than FallbackQuality tells is worth nothing.
  std::uint32_t age = 0;
  friend bool operator==(const Shown&, const Shown&) = default;
};
// What a fresh remote result is worth.
double remote_quality(const Profile& profile, std::size_t level, std::size_t variant);
double quality_of(const Profile& profile, const Shown& shown);

}  // namespace interneuron::eval
