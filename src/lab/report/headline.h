// What the report says first: three sentences of what was compared, who wins and by how much,
// computed from the rows of `table-erdos`. Pure.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/experiments/document.h"

namespace interneuron::report {

// Empty for a document that has no table of ours beside erdos_like.
std::vector<std::string> headline(const experiments::Document& document);

}  // namespace interneuron::report
