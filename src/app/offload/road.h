// `interneuron road`: a roadside unit that detects in the images of any vehicle that comes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/offload/hooks.h"
#include "app/offload/stamp_service.h"
#include "app/settings/key_options.h"
#include "app/settings/peer_address.h"

namespace interneuron::offload {

// The --ladder of a unit that detects nothing and answers only those who measure.
inline constexpr const char* kNoLadder = "none";

struct RoadOptions {
  // As link_options.h reads them, without a peer.
  std::vector<std::string> nics;
  std::string address;
  std::uint16_t port = settings::kDefaultPort;
  // auto, udp or ring.
  std::string transport = "auto";
  std::string ladder = "auto";
  // The vehicles' end-to-end deadline, in milliseconds, for which --ladder auto chooses.
  double deadline_ms = 130;
  std::string data;
  // Where the pictures come from that the detectors are calibrated on.
  std::string video;
  int calibration_runs = 40;
  // No computation is above this level; -1: the budget of each vehicle decides.
  int top_level = -1;
  std::size_t max_peers = 16;
  // Numeric addresses of peers that bring rounds of other vehicles.
  std::vector<std::string> relays;
  settings::KeyOptions keys;
  StampOptions stamp;
};

// Prints the ladder and a line "ready" with the addresses on stdout when vehicles may come, then
// serves until SIGINT or SIGTERM. Returns the program's exit code. `hooks`: what an evaluation adds
// (hooks.h), or nullptr. Throws Failure, IoError and perception::InputError.
int run_road(const RoadOptions& options, RoadHooks* hooks = nullptr);

}  // namespace interneuron::offload
