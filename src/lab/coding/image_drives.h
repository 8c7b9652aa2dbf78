// What a vehicle's camera gets answered on a drive whose modems' rates change (drives.h), in
// virtual time: with the paper's bitmaps and the policy down_sampling, and with JPEGs and the
// policy joint, both under the guard kBudget; each beside a clairvoyant.
//
// The clairvoyant sends any one variant of the same images over any one modem and has it computed
// on at any level, knows all rates and run times beforehand, loses nothing and is never in its own
// way. Of the ways that are in time it takes the one of the highest quality. Pure functions; the
// same arguments give the same rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "lab/coding/drives.h"

namespace interneuron::coding {

// A bitmap of the paper alone takes longer than the paper's 130 ms over most modems.
inline constexpr Duration kImageDeadline = std::chrono::milliseconds(250);

// Rounds that were answered by the roadside unit in time, and the mean AP of all answers (COCO's,
// expected by the level and the image that it was computed on; what is late brings the local one).
struct Answers {
  std::size_t on_time = 0;
  double quality = 0;
};
struct ImageRow {
  // "paper" or "jpeg".
  std::string images;
  std::string policy;
  Answers ours;
  Answers clairvoyant;
  // Rounds on time by variant, the best first.
  std::vector<std::size_t> by_variant;
  // IP bytes that left the vehicle, a round.
  double bytes = 0;
};
struct ImageDriveRow {
  std::string drive;
  // Mean rates of the modems up, Mbit/s.
  std::vector<double> mbit;
  std::size_t rounds = 0;
  std::vector<ImageRow> rows;
};

ImageDriveRow run_image_drive(const Drive& drive, std::size_t rounds, std::uint64_t seed);

}  // namespace interneuron::coding
