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
  // Every packet of the frame is delayed, whichever link it takes.
  kUplink,
  // The computation begins later after the hand-over at the roadside.
  kBeforeCompute,
  // The computation takes longer.
  kInsideCompute,
  // Every packet of the result is delayed, whichever link it takes.
  kDownlink,
};
inline constexpr std::size_t kModules = 4;
// "uplink", "before_compute", "inside_compute" or "downlink".
std::string_view to_string(Module module);

// The share of rounds that are injected. With the uniform law on table_erdos_scenario(), erdos_like
// then misses half of the rounds, as in the paper (152 of 300): it missed 50.1 % of seeds 1001 to
// 1030, 300 rounds each, on which the share was calibrated.
inline constexpr double kCalibratedShare = 0.75;

struct DelayLaw {
  enum class Shape : std::uint8_t { kNone, kUniform, kExponential };
  Shape shape = Shape::kUniform;
  // The bounds of kUniform.
  Duration low = std::chrono::milliseconds(15);
  Duration high = std::chrono::milliseconds(50);
  // Of kExponential.
  Duration mean = std::chrono::milliseconds(40);
  // The share of rounds that are injected, in [0, 1].
  double share = kCalibratedShare;
  // The mean length of a burst in rounds, at least 1. Where a share above burst / (burst + 1)
  // leaves no room between bursts, they grow longer.
  double burst = 4;
};

// Whether rounds are injected, as a chain of two states.
struct BurstChain {
  // The probability that a burst begins after a round that is not injected.
  double begins = 0;
  // The probability that it ends after one that is.
  double ends = 1;
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
