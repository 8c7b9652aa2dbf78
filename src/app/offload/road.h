// `interneuron road`: the roadside unit of any vehicle that comes, its detectors, and the answers
// that it gives to whoever measures the paths to it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/offload/hooks.h"
#include "app/perception/detector.h"
#include "app/settings/key_options.h"
#include "app/settings/peer_address.h"
#include "interneuron/guard.h"

namespace interneuron::offload {

// The --ladder of a unit that detects nothing and answers only those who measure.
inline constexpr const char* kNoLadder = "none";

// How STAMP test packets are answered.
struct StampOptions {
  // 0: no reflector.
  std::uint16_t port = 0;
  bool stateless = false;
  // Also on public addresses.
  bool is_public = false;
};

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
  // Threads that serve vehicles (NodeOptions::shards).
  std::size_t shards = 1;
  // Numeric addresses of peers that bring rounds of other vehicles.
  std::vector<std::string> relays;
  settings::KeyOptions keys;
  StampOptions stamp;
};

// Prints the ladder and a line "ready" with the addresses on stdout when vehicles may come, then
// serves until SIGINT or SIGTERM. Returns the program's exit code. `hooks`: what an evaluation adds
// (hooks.h), or nullptr. Throws Failure, IoError and perception::InputError.
int run_road(const RoadOptions& options, RoadHooks* hooks = nullptr);

// The detectors that the options ask for; nothing for `--ladder none`. Throws what make_ladder()
// throws when models are missing.
std::optional<perception::Ladder> road_ladder(const RoadOptions& options,
                                              const std::optional<std::filesystem::path>& data);

// Runs every level on pictures of the options' video, which takes seconds, and tells what it took,
// from the lowest quality to the highest. The detectors are warm afterwards.
std::vector<LevelProfile> calibrated(perception::Ladder& ladder, const RoadOptions& options,
                                     const std::optional<std::filesystem::path>& data);

// Answers STAMP test packets (RFC 8762, unauthenticated) on some NICs, on a thread of its own: what
// `road --stamp` does, so that others can measure the paths to it. Anybody who reaches the port is
// answered with one packet of the same size, so it amplifies nothing; other reflectors are not
// answered, and no source gets more than SourceLimit lets it have. On public addresses it must
// be asked for (`is_public`), since STAMP knows no keys.
class StampService {
 public:
  // Opens a socket on every NIC that matches a pattern, on the address given or, if that is empty,
  // on all addresses of the NIC. A NIC that goes and comes back is served again within a second.
  // Throws IoError or Failure.
  StampService(const StampOptions& options, const std::vector<std::string>& patterns,
               const std::string& address);
  ~StampService();
  StampService(const StampService&) = delete;
  StampService& operator=(const StampService&) = delete;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron::offload
