// What the program `vehicle` says of its run: a line while it goes on, a summary and files at its
// end.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "app/offload/run_record.h"
#include "app/offload/vehicle.h"
#include "app/process/status_line.h"
#include "interneuron/node.h"

namespace interneuron::offload {

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
