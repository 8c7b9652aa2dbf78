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
  std::string name;  // "raw", "sampled", "jpeg"
  std::size_t bytes = 0;
};

struct Profile {
  std::vector<VariantProfile> variants;  // best first, as they are submitted
  std::vector<std::string> level_names;
  std::vector<LevelProfile> levels;  // quality by variant
  FallbackQuality fallback;          // local: level 0 on raw
};

// The three-level ladder on raw 484x361 and sampled 242x181 RGB (512 and 128 KB with the image
// header), as measured on the whole demo video; with `jpeg`, raw is replaced by a JPEG of quality
// 80 of the full frame (76 KB, nearly as accurate).
Profile default_profile(bool jpeg = false);

// What the application really got in one round.
struct Shown {
  enum class Kind : std::uint8_t { kNothing, kRemote, kLocal, kStale } kind = Kind::kNothing;
  std::size_t level = 0;  // of the (possibly old) remote result
  std::uint8_t variant = 0;
  std::uint32_t age = 0;  // rounds; 0 unless kStale. Older than FallbackQuality tells is worth 0
  friend bool operator==(const Shown&, const Shown&) = default;
};
// Of a fresh remote result.
double remote_quality(const Profile& profile, std::size_t level, std::size_t variant);
double quality_of(const Profile& profile, const Shown& shown);

}  // namespace interneuron::eval
