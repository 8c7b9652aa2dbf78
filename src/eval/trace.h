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
std::string_view to_string(Module module);

struct DelayLaw {
  enum class Shape : std::uint8_t { kNone, kUniform, kExponential };
  Shape shape = Shape::kUniform;
  Duration low = std::chrono::milliseconds(15);   // kUniform
  Duration high = std::chrono::milliseconds(50);  // kUniform
  Duration mean = std::chrono::milliseconds(40);  // kExponential
  double share = 0.72;                            // of rounds, in [0, 1]
  double burst = 4;                               // rounds, mean, >= 1
};

struct Injected {
  bool any = false;
  Module module{};
  Duration delay{};
};

struct Trace {
  std::vector<Injected> rounds;
  // How slow each round's computation is beside its median, in standard deviations of its level:
  // the same for every level and system.
  std::vector<double> compute_noise;
};
Trace make_trace(const DelayLaw& law, std::uint64_t seed, std::uint32_t rounds);

}  // namespace interneuron::eval
