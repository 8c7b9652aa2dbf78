// The policy registry: a PolicySet, looked up by name. Pure.
#pragma once

#include <string_view>

#include "interneuron/policy.h"

namespace interneuron {

// The first policy of that name; null when there is none. Empty entries of the set are skipped.
const Policy* find_policy(const PolicySet& policies, std::string_view name);

}  // namespace interneuron
