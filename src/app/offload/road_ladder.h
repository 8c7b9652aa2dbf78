// The detectors of a roadside unit and how long they take on this host.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "app/offload/road.h"
#include "app/perception/detector.h"
#include "interneuron/guard.h"

namespace interneuron::offload {

// The detectors that the options ask for; nothing for `--ladder none`. Throws what make_ladder()
// throws when models are missing.
std::optional<perception::Ladder> road_ladder(const RoadOptions& options,
                                              const std::optional<std::filesystem::path>& data);

// Runs every level on pictures of the options' video, which takes seconds, and tells what it took,
// from the lowest quality to the highest. The detectors are warm afterwards.
std::vector<LevelProfile> calibrated(perception::Ladder& ladder, const RoadOptions& options,
                                     const std::optional<std::filesystem::path>& data);

}  // namespace interneuron::offload
