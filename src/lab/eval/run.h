// One run of one system in virtual time, and what came of each round. Pure, seeded.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lab/emu/link.h"
#include "lab/eval/erdos.h"
#include "lab/eval/quality.h"
#include "lab/eval/system.h"
#include "lab/eval/trace.h"
#include "lab/sim/world.h"

namespace interneuron::eval {

struct Scenario {
  std::string name;
  std::vector<emu::LinkProfile> links;  // [0]: the primary one of single-link systems
  DelayLaw law;
  Duration deadline = std::chrono::milliseconds(130);
  Duration period = std::chrono::milliseconds(100);
  Profile profile = default_profile();
  std::optional<ErdosTimes> erdos;  // frozen elsewhere; nothing: measured here, see erdos_times()
  sim::ClockError road_clock;
  std::optional<std::pair<std::uint32_t, Duration>>
      clock_step;  // of the road, when this round begins
};
// Constant clean links of 100 and 30 Mbit/s, round trips 22 and 45 ms, with the uniform law of
// docs/evaluation.md.
Scenario table_erdos_scenario();

struct Round {
  std::uint32_t round = 0;
  Duration t0{};  // world time
  bool on_time = false;
  Duration e2e{};  // of the answer
  Shown shown;
  // As decided; for waterfalls and scripted sequences. Elapsed since t0 in world time; nothing:
  // did not come so far.
  std::string plan;                   // "raw:5g sampled:4g"
  std::optional<Duration> delivered;  // θ1: the frame handed over at the roadside
  std::optional<Duration> d1;         // D1 - α, where the verdict tells it: late, or held until D1
  std::optional<Duration> compute_began;
  std::optional<Duration> compute_ended;
  std::uint8_t variant = 0;  // used, as the profile counts them
  std::size_t level = 0;     // computed
  Verdict verdict;           // of stage 1
  bool degraded_first = false;
  bool degraded_final = false;
  std::int16_t x_permille = 0;
  bool recovering = false;
  Injected injected;
  friend bool operator==(const Round&, const Round&) = default;
};

struct Run {
  std::string system;
  std::uint64_t seed = 0;
  std::vector<Round> rounds;
  std::vector<std::uint64_t> bytes_up;  // per link of the scenario, IP, with the warm-up
  std::vector<std::uint64_t> bytes_down;
};

// As many rounds as the trace has. `seed`: of links and endpoints.
Run run(const System& system, const Scenario& scenario, const Trace& trace, std::uint64_t seed);

}  // namespace interneuron::eval
