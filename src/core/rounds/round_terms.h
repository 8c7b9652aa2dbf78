// What a round's header says, in the terms of guards and policies. Pure.
#pragma once

#include "core/guard/round_guard.h"
#include "core/guard/stage_guard.h"
#include "core/wire/round_header.h"
#include "interneuron/message.h"

namespace interneuron {

// Of its message's quality of service.
QoS qos_of(const wire::RoundHeader& header);

// Of the rounds before.
guard::RecentE2e recent_e2e(const wire::RoundHeader& header);

// Of a stage of its round.
guard::StageEnd stage_end(const wire::RoundHeader& header, std::size_t stage);

// Of its round's computation; note_level() and note_computed() write what it reads.
guard::Spent spent_of(const wire::RoundHeader& header);
void note_level(wire::RoundHeader& header, const guard::LevelChoice& choice);
// A computation that took so long has ended.
void note_computed(wire::RoundHeader& header, Duration took);

}  // namespace interneuron
