// The delays that an experiment injects: drawn once per seed, the same for every system that is
// compared (common random numbers). Pure, seeded.
//
// The law: an injected round gets one further delay in one module, drawn uniformly; injected rounds
// come in bursts of geometric length, so that a share of all rounds is injected. Only the share is
// calibrated (by how often erdos_like misses), never a system of ours.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::eval {

enum class Module : std::uint8_t {
  kUplink,         // every packet of the frame, whichever link
  kBeforeCompute,  // between the hand-over at the roadside and the computation
  kInsideCompute,  // the computation takes so much longer
  kDownlink,       // every packet of the result, whichever link
};
inline constexpr std::size_t kModules = 4;
std::string_view to_string(Module module);  // "uplink", "before_compute", …

// Of rounds, with the uniform law on table_erdos_scenario(): erdos_like then misses half of them,
// as in the paper (152 of 300). Calibrated once, on seeds 1001-1030 of 300 rounds: 50.1
// %.
inline constexpr double kCalibratedShare = 0.75;

struct DelayLaw {
  enum class Shape : std::uint8_t { kNone, kUniform, kExponential };
  Shape shape = Shape::kUniform;
  Duration low = std::chrono::milliseconds(15);   // kUniform
  Duration high = std::chrono::milliseconds(50);  // kUniform
  Duration mean = std::chrono::milliseconds(40);  // kExponential
  double share = kCalibratedShare;                // of rounds, in [0, 1]
  // Rounds, mean, >= 1. Where a share above burst / (burst + 1) leaves no room between bursts, they
  // grow longer.
  double burst = 4;
};

// Whether rounds are injected, as a chain of two states.
struct BurstChain {
  double begins = 0;  // probability after a round that is not injected
  double ends = 1;    // after one that is
};
BurstChain burst_chain(const DelayLaw& law);

// The delay that the law has at quantile `u` in [0, 1).
Duration delay_at(const DelayLaw& law, double u);

struct Injected {
  bool any = false;
  Module module{};
  Duration delay{};
  friend bool operator==(const Injected&, const Injected&) = default;
};

struct Trace {
  std::vector<Injected> rounds;
  // How slow each round's computation is beside its median, in standard deviations of its level:
  // the same for every level and system.
  std::vector<double> compute_noise;
};
// A longer trace of a seed begins with the shorter one.
Trace make_trace(const DelayLaw& law, std::uint64_t seed, std::uint32_t rounds);

}  // namespace interneuron::eval
