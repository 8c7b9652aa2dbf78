// The delays that an experiment injects: drawn once per seed, the same for every system that is
// compared (common random numbers). Pure, seeded.
//
// The law: an injected round gets one further delay in one module, drawn by the weights of the law;
// injected rounds come in bursts of geometric length, so that a share of all rounds is injected.
// docs/evaluation.md, "Delays", says what of each law was calibrated, and on which seeds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::eval {

enum class Module : std::uint8_t {
  // Every packet of the frame is delayed, on the links that Injected::link tells.
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
  // The mean of kExponential.
  Duration mean = std::chrono::milliseconds(40);
  // The share of rounds that are injected, in [0, 1].
  double share = kCalibratedShare;
  // The mean length of a burst in rounds, at least 1. Where a share above burst / (burst + 1)
  // leaves no room between bursts, they grow longer.
  double burst = 4;
  // How likely each module is the one that is delayed, in the order of Module; not all zero.
  std::array<double, kModules> modules{1, 1, 1, 1};
  // The link whose frames are delayed in the uplink; empty: every link.
  std::optional<std::size_t> uplink_of{};
};

// Delays of one network, as the paper's text has them ("the raw network first"): nearly all of them
// in the uplink of the primary link, the one that carries the raw image, the others before the
// computation. With them the guard `paper` has what the paper's table shows. Share, mix and length
// of bursts were fitted to that table, erdos_like's and paper's rows, on seeds 2001 to 2030.
DelayLaw per_nic_law();

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
  // The only link on which the uplink is delayed; empty: every link.
  std::optional<std::size_t> link{};
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
