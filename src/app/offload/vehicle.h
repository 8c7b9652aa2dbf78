// `interneuron vehicle`: sends camera frames through the pipeline and gets exactly one answer per
// round.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/offload/hooks.h"

namespace interneuron::cli {

struct VehicleOptions {
  // As link_options.h reads them: the roadside unit as reached over each card.
  std::vector<std::string> links;
  std::uint16_t port = 0;
  std::string video;
  std::string data;
  std::string ladder = "auto";  // of the local backup: its lowest level
  std::string truth;            // "none": no accuracy even when there is ground truth
  std::uint32_t rounds = 0;     // 0: to the end of the video, or SIGINT
  double deadline_ms = 130;
  double period_ms = 100;
  std::string policy = "down_sampling";
  std::string guard = "budget";
  double beta = 0;
  double wait_s = 30;    // for the roadside unit to answer
  double objective = 0;  // per cent of rounds on time; less ends with exit code 4
  std::string out;       // folder; empty: nothing is written
  bool json = false;
  bool table = true;
  bool quiet = false;
  // Set by the demo: where the testbed is described, to be told in the summary.
  std::vector<std::string> profiles;
  std::int64_t seed = -1;
};

// `hooks`: what an evaluation adds, if any (hooks.h).
int run_vehicle(const VehicleOptions& options, VehicleHooks* hooks = nullptr);

}  // namespace interneuron::cli
