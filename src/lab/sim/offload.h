// The paper's pipeline in virtual time: a vehicle sends a camera frame per round, the roadside unit
// detects at the level that the guard allows, and the result comes back, while a local backup runs
// on the vehicle. Endpoints, policies, guards, links and computing::RoadsideUnit are the production
// code; only the detection is replaced by a run time per level.
//
// Pure and seeded: the same options give the same run to the last bit. Thread-compatible; several
// runs may go on in several threads.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/ablation.h"
#include "interneuron/endpoint.h"
#include "interneuron/guard.h"
#include "lab/emu/link.h"
#include "lab/sim/world.h"

namespace interneuron::sim {

// The levels of the simulated computation and how long a run at each of them takes: what stands in
// for a detector in virtual time. Pure functions.
struct LevelRuntime {
  std::string name;
  Duration median{};
  Duration p95{};
  // As LevelProfile::quality.
  std::vector<double> quality{};
};

// Three levels of one detector on one thread, from the lightest to the best. The quality is the
// average precision measured on raw and on sampled images (docs/constants.md, "Images and
// detectors").
std::vector<LevelRuntime> default_ladder();
// The same levels on the JPEGs of the codec (`--images jpeg`), with the mean bytes of each rung on
// the demo video and what it takes to make all of them.
std::vector<LevelRuntime> jpeg_ladder();
inline constexpr std::array<std::size_t, 4> kJpegBytes{45'600, 24'800, 15'800, 10'000};
inline constexpr Duration kJpegEncode = std::chrono::microseconds(5000);
// The same as an endpoint takes it.
std::vector<LevelProfile> profiles_of(const std::vector<LevelRuntime>& ladder);

// Run times are half-normal: half of them are above the median, and these lie further away from it
// than the others. How slow a run is counts in standard deviations of its level from the level's
// median, so that the same figure makes a run as slow at one level as at another.
//
// That figure for a run, `unit_normal` being drawn from the standard normal distribution.
double half_normal_deviations(double unit_normal);
// The run time at a level with this median and 95th percentile; never less than half the median.
Duration runtime_of(Duration median, Duration p95, double deviations);

// What resizing and copying a frame of 768x576 takes on the vehicle before it is handed over, as
// measured: HostTimes::encode by default.
inline constexpr Duration kEncode = std::chrono::milliseconds(1);

// What the hosts themselves take of a round beyond the links' time and the computation.
struct HostTimes {
  // From t0 until the variants are made and submitted.
  Duration encode = kEncode;
  // What the packets of an image and of a result spend in both hosts: they are cut, sealed, sent in
  // turns by system calls, received and put together, and the whole is handed over to a worker. In
  // virtual time that takes no time unless an experiment knows what it took on a real machine.
  Duration image_packets{};
  Duration result_packets{};
};

// Links are measured for so long before the first round.
inline constexpr Duration kWarmUp = std::chrono::seconds(1);

// Bytes of a result with 100 boxes; the paper's results have at most 5 KB.
inline constexpr std::size_t kResultBytes = 3000;

// What is done to one round from outside.
struct Disturbance {
  // A further delay of every packet of the frame, per link. Links beyond the last entry have the
  // last; an empty vector delays nothing.
  std::vector<Duration> uplink;
  // Passes between the hand-over at the roadside unit and the computation.
  Duration before_compute{};
  // The computation takes so much longer.
  Duration inside_compute{};
  // A further delay of every packet of the result, on any link.
  Duration downlink{};
  // How slow the round's computations are, in standard deviations, instead of what would be drawn.
  std::optional<double> deviations;
};

// The level of a round's computation, by the times since t0 at which the frame was handed over and
// at which the computation begins.
using LevelRule =
    std::function<std::size_t(std::uint32_t round, Duration delivered, Duration began)>;

struct OffloadOptions {
  std::uint64_t seed = 1;
  std::uint32_t rounds = 300;
  Duration period = std::chrono::milliseconds(100);
  Duration deadline = std::chrono::milliseconds(130);
  // One per link; both directions share its delay process.
  std::vector<emu::LinkProfile> profiles;
  // The hosts have this link alone.
  std::optional<std::size_t> only_link;
  std::string policy = "down_sampling";
  GuardKind guard = GuardKind::kPaper;
  FallbackQuality fallback;
  std::vector<LevelRuntime> ladder = default_ladder();
  // The level that the guard steps down from. Nothing: the highest whose 95th percentile fits what
  // the links leave for the computation.
  std::optional<std::size_t> top_level;
  // Without a top level: the vehicle corrects what the links leave by its first rounds, as
  // `interneuron vehicle` does, and the top level follows.
  bool learns_budget = false;
  // Sizes of the variants in bytes, best first: the paper's raw and sampled images (docs/paper.md)
  // with their headers.
  std::vector<std::size_t> variant_bytes = {484 * 361 * 3 + 32, 242 * 181 * 3 + 32};
  std::size_t result_bytes = kResultBytes;
  HostTimes hosts{};
  std::int16_t beta_permille = 0;
  Ablation ablation{};
  bool local_backup = true;
  // Run times vary around the median; without it each run takes the median.
  bool compute_noise = true;
  // Determines the level instead of the guard.
  LevelRule level_rule;
  // By round; further rounds have none.
  std::vector<Disturbance> disturbances;
  ClockError vehicle_clock;
  ClockError road_clock;
  // When this round begins, the clock of the roadside unit steps by so much.
  std::optional<std::pair<std::uint32_t, Duration>> road_step;
  Duration warm_up = kWarmUp;
  // Both hosts have keys, and talk as `interneuron vehicle` and `road` do.
  bool is_encrypted = false;
};

// What happened in one round. Instants are of world time.
struct OffloadRound {
  std::uint32_t round = 0;
  Duration t0{};
  // How often the application was answered. Anything but 1 is a fault of the middleware.
  std::uint32_t answers = 0;
  bool answered() const { return answers > 0; }
  RoundDone done;
  // The plan of the frame's transmission.
  Plan plan;
  // As the roadside unit saw the round; nothing when no frame was handed over there.
  struct AtRoad {
    // Index among the variants that were submitted.
    std::uint8_t variant = 0;
    // The verdict on stage 1, the transmission of the frame.
    Verdict verdict;
    bool degraded = false;
    Duration delivered{};
    // The computation began and ended; nothing if it never did.
    std::optional<Duration> began;
    std::optional<Duration> ended;
    std::size_t level = 0;
  };
  std::optional<AtRoad> at_road;
  // Whether some choice would have answered the round remotely in time; see
  // clairvoyant_feasible().
  bool feasible = false;
};

struct OffloadResult {
  std::vector<OffloadRound> rounds;
  std::size_t top_level = 0;
  std::uint32_t on_time() const;
  std::uint32_t feasible() const;
  // At either end.
  std::vector<PathChanged> path_changes;
  std::size_t max_reassembly_bytes = 0;
  // Per profile; zeros for a link that the hosts do not have.
  std::vector<emu::DirectionStats> up;
  std::vector<emu::DirectionStats> down;
};

// Runs all rounds to their ends. `prepare` sees the world before the first packet, to change links
// or watch packets; the vehicle is host 0, the roadside unit host 1.
OffloadResult run_offload(const OffloadOptions& options,
                          const std::function<void(World&)>& prepare = nullptr);

}  // namespace interneuron::sim
