// The scripted sequence behind the paper's figure of its real-time guarantee (docs/paper.md, "The
// scripted sequence"), with the production endpoints, guard kPaper, constant links and extra
// delays. Pure.
//
// Rounds 0-2 are normal. In 3-4 the raw image is slower but within D1. In 5-7 it misses D1 and the
// sampled image is used at exactly D1. In 8-12 both are slow and D1 is missed, so a lighter model
// detects (8-9), then the lightest (10-12). In 11-12 D2 is missed too.
#pragma once

#include <cstdint>
#include <functional>

#include "lab/sim/offload.h"

namespace interneuron::sim {

inline constexpr std::uint32_t kFigRtRounds = 13;

// `prepare` sees the world before its first packet, as that of run_offload().
OffloadResult run_fig_rt_guarantee(const std::function<void(World&)>& prepare = nullptr);

}  // namespace interneuron::sim
