// What a run of the vehicle consists of beside its rounds: the images that it offers of a frame and
// the detectors of this host, before; the line while it goes on; the summary and the files at its
// end.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/offload/camera.h"
#include "app/offload/run_record.h"
#include "app/offload/vehicle.h"
#include "app/perception/codec.h"
#include "app/perception/detector.h"
#include "app/process/status_line.h"
#include "interneuron/guard.h"
#include "interneuron/message.h"
#include "interneuron/node.h"

namespace interneuron::offload {

// "joint" for JPEGs, "down_sampling" for the paper's images.
std::string default_policy(perception::Images images);

// The variants of a frame as messages, the best first, each behind the request (offload_request.h)
// that it be computed on within `budget`. JPEGs take milliseconds. Thread-safe.
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

// The detectors of this host: the first `levels` of them; 0: all. Throws what make_ladder() throws.
perception::Ladder local_ladder(const VehicleOptions& options,
                                const std::optional<std::filesystem::path>& data,
                                std::size_t levels);

// What the roadside unit is believed to compute with: the detectors that this host would have, at
// the run times and qualities that were measured of them. The results' run times correct the first;
// a unit with other detectors is weighed wrongly, which costs a worse choice and no more. Empty
// where the qualities are not known.
std::vector<LevelProfile> believed_levels(const perception::Ladder& ladder,
                                          perception::Images images);

// What a run was made with, beside its options.
struct VehicleRun {
  std::optional<std::filesystem::path> data;
  std::string video;
  // The local backup in one line.
  std::string backup;
};

// Says how many rounds there were and how they ended: in the line of a terminal, else on stderr
// every 50 rounds or so. `last`: the run is over.
void show_progress(process::StatusLine& line, const RunRecord::Counts& counts, std::uint32_t rounds,
                   bool last);

// Writes the files of the run and prints its summary, as the options ask for. Returns the exit
// code: kObjectiveMissed when too few rounds were on time. Throws Failure (1) naming a file.
int report_run(const VehicleOptions& options, const VehicleRun& run, RunRecord& record,
               const Statistics& statistics);

// The ground truth that the answers are compared with; nothing when there is none for the video.
std::optional<std::filesystem::path> truth_of(const VehicleOptions& options,
                                              const std::optional<std::filesystem::path>& data,
                                              const std::string& video);

}  // namespace interneuron::offload
