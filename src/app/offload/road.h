// `interneuron road`: a roadside unit that detects in the images of any vehicle that comes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/offload/hooks.h"
#include "app/offload/stamp_service.h"
#include "host/settings/peer_address.h"

namespace interneuron::cli {

// --ladder: detects nothing, answers only those who measure.
inline constexpr const char* kNoLadder = "none";

struct RoadOptions {
  std::vector<std::string> nics;  // as link_options.h reads them, without a peer
  std::string address;
  std::uint16_t port = kDefaultPort;
  std::string ladder = "auto";
  // The vehicles' end-to-end deadline, in milliseconds, for which --ladder auto chooses.
  double deadline_ms = 130;
  std::string data;
  std::string video;  // pictures to calibrate on
  int calibration_runs = 40;
  int top_level = -1;  // -1: by the vehicle's budget
  std::size_t max_peers = 16;
  bool insecure = false;
  StampOptions stamp;
};

// `hooks`: what an evaluation adds, if any (hooks.h).
// Serves until SIGINT or SIGTERM. Prints "ready …" on stdout when vehicles may come.
int run_road(const RoadOptions& options, RoadHooks* hooks = nullptr);

}  // namespace interneuron::cli
