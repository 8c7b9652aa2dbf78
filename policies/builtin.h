// The built-in policies, one per file. Each file says what its policy does.
#pragma once

#include <memory>

#include "interneuron/policy.h"

namespace interneuron::policies {

std::shared_ptr<const Policy> best_link();
std::shared_ptr<const Policy> duplicate();
std::shared_ptr<const Policy> down_sampling();

}  // namespace interneuron::policies
