#include "lab/eval/trace.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "lab/emu/random.h"
#include "lab/sim/offload.h"

namespace interneuron::eval {
namespace {

// Streams of their own, so that a change of one part of the law leaves the others.
enum class Stream : std::uint64_t { kBurst = 1, kModule, kDelay, kNoise };

emu::RandomStream stream_of(std::uint64_t seed, Stream stream) {
  return emu::RandomStream(emu::split_mix(seed) ^ static_cast<std::uint64_t>(stream));
}

// Box and Muller 1958.
double unit_normal(emu::RandomStream& stream) {
  const double radius = std::sqrt(-2 * std::log1p(-stream.uniform()));
  return radius * std::cos(2 * std::numbers::pi * stream.uniform());
}

// `drawn`: uniform over 64 bits.
Module module_at(const DelayLaw& law, std::uint64_t drawn) {
  if (law.modules == DelayLaw{}.modules) return static_cast<Module>(drawn % kModules);
  double left = std::accumulate(law.modules.begin(), law.modules.end(), 0.0) *
                std::ldexp(static_cast<double>(drawn >> 11), -53);
  std::size_t i = 0;
  while (i + 1 < kModules && left >= law.modules[i]) left -= law.modules[i++];
  return static_cast<Module>(i);
}

}  // namespace

DelayLaw per_nic_law() {
  return DelayLaw{.share = 0.6, .burst = 2.5, .modules = {0.94, 0.06, 0, 0}, .uplink_of = 0};
}

std::string_view to_string(Module module) {
  switch (module) {
    case Module::kUplink:
      return "uplink";
    case Module::kBeforeCompute:
      return "before_compute";
    case Module::kInsideCompute:
      return "inside_compute";
    case Module::kDownlink:
      return "downlink";
  }
  return "";
}

BurstChain burst_chain(const DelayLaw& law) {
  if (law.shape == DelayLaw::Shape::kNone || law.share <= 0) return {0, 1};
  if (law.share >= 1) return {1, 0};
  const double odds = law.share / (1 - law.share);
  const double ends = std::min(1 / law.burst, 1 / odds);
  return {ends * odds, ends};
}

Duration delay_at(const DelayLaw& law, double u) {
  switch (law.shape) {
    case DelayLaw::Shape::kUniform:
      return law.low + from_ms(u * to_ms(law.high - law.low));
    case DelayLaw::Shape::kExponential:
      return from_ms(-to_ms(law.mean) * std::log1p(-u));
    case DelayLaw::Shape::kNone:
      break;
  }
  return {};
}

Trace make_trace(const DelayLaw& law, std::uint64_t seed, std::uint32_t rounds) {
  emu::RandomStream burst = stream_of(seed, Stream::kBurst);
  emu::RandomStream module = stream_of(seed, Stream::kModule);
  emu::RandomStream delay = stream_of(seed, Stream::kDelay);
  emu::RandomStream noise = stream_of(seed, Stream::kNoise);
  const BurstChain chain = burst_chain(law);
  const bool injects = law.shape != DelayLaw::Shape::kNone;
  Trace trace;
  bool injected = injects && burst.uniform() < law.share;
  for (std::uint32_t i = 0; i < rounds; ++i) {
    const Module which = module_at(law, module.next());
    const Duration length = delay_at(law, delay.uniform());
    const auto link = which == Module::kUplink ? law.uplink_of : std::nullopt;
    trace.rounds.push_back(injected ? Injected{true, which, length, link} : Injected{});
    trace.compute_noise.push_back(sim::half_normal_deviations(unit_normal(noise)));
    const double drawn = burst.uniform();
    injected = injected ? drawn >= chain.ends : drawn >= 1 - chain.begins;
  }
  return trace;
}

}  // namespace interneuron::eval
