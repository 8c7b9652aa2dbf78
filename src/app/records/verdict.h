// What a run comes to: a sentence for people, and whether it met the objective.
#pragma once

#include <string>

#include "app/records/json_file.h"

namespace interneuron::records {

// One sentence: how many rounds the roadside unit answered within the deadline, and who answered
// the others. `summary` is what summarise() returns.
std::string verdict(const Json& summary);

// Returns kFine when at least `percent` per cent of the rounds were on time, or when `percent` is
// 0, which means no objective. Otherwise says on stderr by how much it was missed and returns
// kObjectiveMissed.
int judge_objective(const Json& summary, double percent);

}  // namespace interneuron::records
