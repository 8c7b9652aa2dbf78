// The paper's pipeline in virtual time: a vehicle sends a camera frame per round, the roadside
// detects at the level the guard allows, the result comes back; a local backup runs beside it. The
// endpoints, policies, guard and links are the production code; only the computation is replaced by
// a runtime per level. Pure, seeded.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "interneuron/endpoint.h"
#include "lab/emu/link.h"
#include "lab/sim/world.h"

namespace interneuron::sim {

// Resizing and copying a frame on the vehicle before it is handed over; measured 1 ms for 768x576.
inline constexpr Duration kEncode = std::chrono::milliseconds(1);

// Links are measured for so long before the first round.
inline constexpr Duration kWarmUp = std::chrono::seconds(1);
// The size of a result of 100 boxes, in bytes; the paper's has at most 5 KB.
inline constexpr std::size_t kResultBytes = 3000;

struct LevelRuntime {
  std::string name;
  Duration median{};
  Duration p95{};
  std::vector<double> quality{};  // as LevelProfile::quality
};

// Three levels with their single-threaded run times and their AP on raw and sampled images
// (docs/constants.md, "Images and detectors").
std::vector<LevelRuntime> default_ladder();

// Run times are half-normal: skewed to the slow side, the median kept. `deviations`: how slow this
// one is beside the median, in standard deviations of its level.
double half_normal_deviations(double unit_normal);
Duration runtime_of(Duration median, Duration p95, double deviations);

// What is done to one round from outside.
struct Disturbance {
  // Further delay of every packet of the frame, per link; links beyond the last one have the last.
  std::vector<Duration> uplink;
  Duration before_compute{};         // between the hand-over at the roadside and the computation
  Duration inside_compute{};         // the computation takes so much longer
  Duration downlink{};               // further delay of every packet of the result, on any link
  std::optional<double> deviations;  // of the round's computations, instead of those drawn
};

struct OffloadOptions {
  std::uint64_t seed = 1;
  std::uint32_t rounds = 300;
  Duration period = std::chrono::milliseconds(100);
  Duration deadline = std::chrono::milliseconds(130);
  std::vector<emu::LinkProfile> profiles;  // one per link, both directions sharing a process
  std::optional<std::size_t> only_link;    // the hosts have this one alone
  std::string policy = "down_sampling";
  GuardKind guard = GuardKind::kPaper;
  FallbackQuality fallback;
  std::vector<LevelRuntime> ladder = default_ladder();
  std::optional<std::size_t> top_level;  // default: the highest whose p95 fits the budget
  // Sizes in bytes, best first, with the image header: the paper's 512 KB raw and 128 KB sampled.
  std::vector<std::size_t> variant_bytes = {484 * 361 * 3 + 32, 242 * 181 * 3 + 32};
  std::optional<std::size_t> only_variant;  // submits this one alone
  std::size_t result_bytes = kResultBytes;
  std::int16_t beta_permille = 0;
  bool repair = true;
  bool use_x = true;
  bool use_handler = true;
  bool local_backup = true;
  bool compute_noise = true;  // run times vary around the median as measured
  // Chooses the level instead of the guard, by the time since t0 at which the frame was handed over
  // and at which its computation begins.
  std::function<std::size_t(Duration delivered, Duration began)> level_rule;
  std::vector<Disturbance> disturbances;  // by round; further rounds have none
  ClockError vehicle_clock;
  ClockError road_clock;
  // When this round begins, the road's clock steps by so much.
  std::optional<std::pair<std::uint32_t, Duration>> road_step;
  Duration warm_up = kWarmUp;
};

// What happened in one round. Instants are world time.
struct OffloadRound {
  std::uint32_t round = 0;
  Duration t0{};
  std::uint32_t answers = 0;  // exactly 1, or the middleware is wrong
  bool answered() const { return answers > 0; }
  RoundDone done;
  Plan plan;  // of the frame
  // As the roadside saw it; nothing when no frame was delivered there.
  struct AtRoad {
    std::uint8_t variant = 0;  // of those that were submitted
    Verdict verdict;           // of stage 1
    bool degraded = false;
    Duration delivered{};
    std::optional<Duration> began;  // the computation
    std::optional<Duration> ended;
    std::size_t level = 0;
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
  std::vector<emu::DirectionStats> up;  // per profile
  std::vector<emu::DirectionStats> down;
};

OffloadResult run_offload(const OffloadOptions& options,
                          const std::function<void(World&)>& prepare = nullptr);

// What a message of so many bytes is on a link: with the round's header and the headers of each
// packet down to IPv4's.
std::size_t bytes_on_wire(std::size_t message_bytes);

// Whether some choice of variant, links and level answers a round begun at `t0` by its deadline,
// knowing the links' processes (but not their losses): the smallest variant over either link, the
// lowest level, either link back.
bool clairvoyant_feasible(const std::vector<emu::LinkProfile>& profiles,
                          const std::vector<emu::DelayProcess*>& processes, Duration t0,
                          Duration deadline, std::size_t smallest_bytes, std::size_t result_bytes,
                          Duration fastest_compute);

}  // namespace interneuron::sim
