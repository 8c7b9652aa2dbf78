#include "lab/sim/fig_rt_guarantee.h"

namespace interneuron::sim {
namespace {

using std::chrono::milliseconds;

// Extra delays by round, in ms, of the links that carry the raw and the sampled image. They are
// just so large that each phase of the paper's figure comes about on the links below.
constexpr int kExtraMs[kFigRtRounds][2] = {{0, 0},   {0, 0},   {0, 0},  {4, 0},   {4, 0},
                                           {60, 0},  {60, 0},  {60, 0}, {90, 22}, {90, 27},
                                           {90, 44}, {90, 66}, {90, 65}};

}  // namespace

OffloadResult run_fig_rt_guarantee(const std::function<void(World&)>& prepare) {
  OffloadOptions o;
  o.rounds = kFigRtRounds;
  o.profiles = {emu::constant_link("5g", 10, 100, 300), emu::constant_link("4g", 30, 30, 75)};
  // Three sets of weights as in the paper: the lightest far quicker than the two others.
  o.ladder = {{"n", milliseconds(5), milliseconds(5)},
              {"l", milliseconds(35), milliseconds(35)},
              {"x6", milliseconds(44), milliseconds(44)}};
  o.top_level = 2;
  o.compute_noise = false;
  o.ablation.repair = false;
  for (const auto& [raw, sampled] : kExtraMs) {
    o.disturbances.emplace_back().uplink = {milliseconds(raw), milliseconds(sampled)};
  }
  return run_offload(o, prepare);
}

}  // namespace interneuron::sim
