// How many measuring packets one source is answered by the reflectors of this folder.
#pragma once

#include "core/base/source_limit.h"

namespace interneuron::probe {

// 2,000 answers a second: twice what the shortest interval of `interneuron probe`, 1 ms, asks for,
// so that two hosts behind one address fit.
inline constexpr Duration kAnswerInterval = std::chrono::microseconds(500);
// Answers at once after a pause: the 8 trains of 256 packets with which `interneuron probe`
// measures a rate.
inline constexpr int kAnswerBurst = 8 * 256;

}  // namespace interneuron::probe
