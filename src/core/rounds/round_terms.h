// What a round's header says, in the terms of guards and policies. The header is a peer's bytes
// that parse_round_header() found to be well-formed. Pure.
#pragma once

#include "core/guard/round_guard.h"
#include "core/guard/stage_guard.h"
#include "core/wire/round_header.h"
#include "interneuron/message.h"

namespace interneuron {

// The quality of service that this header asks for.
QoS qos_of(const wire::RoundHeader& header);

// The end-to-end times of the 16 rounds before.
guard::RecentE2e recent_e2e(const wire::RoundHeader& header);

// The end of a stage of this round.
guard::StageEnd stage_end(const wire::RoundHeader& header, std::size_t stage);

// What the header says of the computations of its round.
guard::Spent spent_of(const wire::RoundHeader& header);
// Writes that a computation has begun at this level.
void note_level(wire::RoundHeader& header, const guard::LevelChoice& choice);
// Writes that a computation on the header's variant has ended after `took`.
void note_computed(wire::RoundHeader& header, Duration took);

}  // namespace interneuron
