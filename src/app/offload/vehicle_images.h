// Which images a vehicle offers of its frames, what it takes to make them, and what they are
// believed to be worth at the roadside. Errors: what make_ladder() throws. Thread-safe.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/offload/camera.h"
#include "app/offload/vehicle.h"
#include "app/perception/codec.h"
#include "app/perception/detector.h"
#include "interneuron/guard.h"
#include "interneuron/message.h"

namespace interneuron::offload {

// The variants of a frame as messages, the best first, each behind the request (offload_request.h)
// that it be computed on within `budget`. JPEGs take milliseconds.
Variants encoded(const Camera::Shot& shot, perception::Images images, Duration budget);

// What it takes to make the variants of a frame, and the bytes of the best one.
struct Encoding {
  Duration time{};
  std::size_t bytes = 0;
};
// Measured, which takes some 30 ms, on noise that is much like a frame of the demo video: the
// slowest of a few runs, since a budget that is too small costs less than one that is too large.
// The first rounds correct it (ComputationBudget::learn).
Encoding encoding_of(perception::Images images);

// The detectors of this host: the first `levels` of them; 0: all.
perception::Ladder local_ladder(const VehicleOptions& options,
                                const std::optional<std::filesystem::path>& data,
                                std::size_t levels);

// What the roadside unit is believed to compute with: the detectors that this host would have, at
// the run times and qualities that were measured of them. The results' run times correct the first;
// a unit with other detectors is weighed wrongly, which costs a worse choice and no more. Empty
// where the qualities are not known.
std::vector<LevelProfile> believed_levels(const perception::Ladder& ladder,
                                          perception::Images images);

}  // namespace interneuron::offload
