// The scripted sequence of the paper's figure of its real-time guarantee (docs/paper.md, "The
// scripted sequence") through the production endpoints: guard kPaper, constant links, scripted
// extra delays. Pure.
//
// Rounds 0-2 normal; 3-4 the raw image is slower but within D1; 5-7 it misses D1 and the sampled
// image is used at exactly D1; 8-12 both are slow, D1 is missed: a lighter model (8-9), the
// lightest (10-12); 11-12 D2 is missed too.
#pragma once

#include <cstdint>
#include <functional>

#include "lab/sim/offload.h"

namespace interneuron::sim {

inline constexpr std::uint32_t kFigRtRounds = 13;

// `prepare` sees the world before it begins, as run_offload()'s. The vehicle is host 0.
OffloadResult run_fig_rt_guarantee(const std::function<void(World&)>& prepare = nullptr);

}  // namespace interneuron::sim
