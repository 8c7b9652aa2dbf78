// The paper's pipeline in virtual time: a vehicle sends a camera frame per round, the roadside
// detects at the level the guard allows, the result comes back; a local backup runs beside it. The
// endpoints, policies, guard and links are the production code; only the computation is replaced by
// a runtime per level. Pure, seeded.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "emu/link.h"
#include "interneuron/endpoint.h"
#include "sim/world.h"

namespace interneuron::sim {

struct LevelRuntime {
  std::string name;
  Duration median{};
  Duration p95{};
};

// Single-threaded run times of the three-level ladder (realtime.md §3.4, C++ columns).
std::vector<LevelRuntime> default_ladder();

struct OffloadOptions {
  std::uint64_t seed = 1;
  std::uint32_t rounds = 300;
  Duration period = std::chrono::milliseconds(100);
  Duration deadline = std::chrono::milliseconds(130);
  std::vector<emu::LinkProfile> profiles;  // one per link, both directions sharing a process
  std::string policy = "down_sampling";
  std::vector<LevelRuntime> ladder = default_ladder();
  std::optional<std::size_t> top_level;            // default: the highest whose p95 fits the budget
  std::size_t raw_bytes = 484 * 361 * 3 + 32;      // NOTES §3: 512 KB; with the image header
  std::size_t sampled_bytes = 242 * 181 * 3 + 32;  // 128 KB
  std::size_t result_bytes = 3000;                 // 100 boxes at most; NOTES §3: <= 5 KB
  std::int16_t beta_permille = 0;
  bool repair = true;
  bool use_x = true;
  bool use_handler = true;
  bool local_backup = true;
  bool compute_noise = true;  // run times vary around the median as measured
  ClockError vehicle_clock;
  ClockError road_clock;
  Duration warm_up = std::chrono::seconds(1);  // links are measured before the first round
};

// What happened in one round.
struct OffloadRound {
  std::uint32_t round = 0;
  Duration t0{};              // world time
  std::uint32_t answers = 0;  // exactly 1, or the middleware is wrong
  bool answered() const { return answers > 0; }
  RoundDone done;
  // As the roadside saw it; nothing when no frame was delivered there.
  struct AtRoad {
    std::uint8_t variant = 0;
    Verdict verdict;  // of stage 1
    bool degraded = false;
    std::size_t level = 0;
    Duration compute{};
  };
  std::optional<AtRoad> at_road;
  // By how much the round could still have been answered remotely, whatever had been decided: the
  // clairvoyant best.
  bool feasible = false;
};

struct OffloadResult {
  std::vector<OffloadRound> rounds;
  std::size_t top_level = 0;
  std::uint32_t on_time() const;
  std::uint32_t feasible() const;
  std::vector<PathChanged> path_changes;  // at either end
  std::size_t max_reassembly_bytes = 0;
  std::vector<emu::DirectionStats> up;  // per link
  std::vector<emu::DirectionStats> down;
};

OffloadResult run_offload(const OffloadOptions& options,
                          const std::function<void(World&)>& prepare = nullptr);

// Whether some choice of variant, links and level answers a round begun at `t0` by its deadline,
// knowing the links' processes (but not their losses): the smallest variant over either link, the
// lowest level, either link back.
bool clairvoyant_feasible(const std::vector<emu::LinkProfile>& profiles,
                          const std::vector<emu::DelayProcess*>& processes, Duration t0,
                          Duration deadline, std::size_t smallest_bytes, std::size_t result_bytes,
                          Duration fastest_compute);

}  // namespace interneuron::sim
