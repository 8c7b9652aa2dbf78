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
#include "lab/sim/offload.h"
#include "lab/sim/world.h"

namespace interneuron::eval {

struct Scenario {
  std::string name;
  // The first one is the only one of systems with a single link.
  std::vector<emu::LinkProfile> links;
  DelayLaw law;
  Duration deadline = std::chrono::milliseconds(130);
  Duration period = std::chrono::milliseconds(100);
  Profile profile = default_profile();
  // What erdos_like froze elsewhere; empty: it is measured here, see erdos_times().
  std::optional<ErdosTimes> erdos;
  sim::ClockError road_clock;
  // By how much the roadside's clock steps when this round begins.
  std::optional<std::pair<std::uint32_t, Duration>> clock_step;
  // See sim::OffloadOptions.
  bool is_encrypted = false;
  bool learns_budget = false;
  sim::HostTimes hosts{};
};
// Constant clean links of 100 and 30 Mbit/s, round trips 22 and 45 ms, with the uniform law of
// docs/evaluation.md.
Scenario table_erdos_scenario();

struct Round {
  std::uint32_t round = 0;
  // World time.
  Duration t0{};
  bool on_time = false;
  // The end-to-end time of the answer.
  Duration e2e{};
  Shown shown;
  // The links that the frame was planned on: "raw:5g sampled:4g".
  std::string plan;
  // Since t0 in world time, empty for a round that did not come so far: when the frame was handed
  // over at the roadside (θ1), what its deadline was (D1 - α, where the verdict tells it: late, or
  // held until D1), and when the computation began and ended.
  std::optional<Duration> delivered;
  std::optional<Duration> d1;
  std::optional<Duration> compute_began;
  std::optional<Duration> compute_ended;
  // The variant that was used, as the profile counts them, and the level that was computed.
  std::uint8_t variant = 0;
  std::size_t level = 0;
  // The verdict on stage 1, the transmission of the frame.
  Verdict verdict;
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
  // Bytes of IP by link of the scenario, those of the warm-up included.
  std::vector<std::uint64_t> bytes_up;
  std::vector<std::uint64_t> bytes_down;
};

// Runs as many rounds as the trace has. `seed` is that of links and endpoints.
Run run(const System& system, const Scenario& scenario, const Trace& trace, std::uint64_t seed);

}  // namespace interneuron::eval
