// `interneuron vehicle`: sends camera frames through the pipeline and gets exactly one answer per
// round.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/offload/hooks.h"
#include "app/settings/key_options.h"

namespace interneuron::offload {

struct VehicleOptions {
  // The roadside unit as reached over each card, as link_options.h reads it.
  std::vector<std::string> links;
  settings::KeyOptions keys;
  std::uint16_t port = 0;
  // auto, udp or ring.
  std::string transport = "auto";
  std::string video;
  std::string data;
  // The detectors of the local backup, which runs their lowest level.
  std::string ladder = "auto";
  // A file, or "none": then no accuracy is told even where there is ground truth.
  std::string truth;
  // 0: to the end of the video, or SIGINT.
  std::uint32_t rounds = 0;
  double deadline_ms = 130;
  double period_ms = 100;
  // Which variants of a frame are offered to the policy, as perception::parse_images() reads it.
  std::string images = "jpeg";
  // Empty: default_policy() of the images.
  std::string policy;
  std::string guard = "budget";
  double beta = 0;
  // For how long the roadside unit is waited for, in seconds.
  double wait_s = 30;
  // With fewer rounds on time, in per cent, the program ends with exit code 4.
  double objective = 0;
  // Folder of the results; if empty, nothing is written.
  std::string out;
  bool json = false;
  bool table = true;
  bool quiet = false;
  // Set by the demo for the summary: the profiles and the seed of its testbed; a negative seed
  // means none.
  std::vector<std::string> profiles;
  std::int64_t seed = -1;
};

// Begins rounds until the source ends, the number of rounds is reached or SIGINT or SIGTERM comes,
// and returns the program's exit code. `hooks`: what an evaluation adds (hooks.h), or nullptr.
// Throws Failure, IoError and perception::InputError.
int run_vehicle(const VehicleOptions& options, VehicleHooks* hooks = nullptr);

}  // namespace interneuron::offload
