// The built-in policies, one per file. Each file says what its policy does.
#pragma once

#include <memory>

#include "interneuron/policy.h"

namespace interneuron::policies {

std::shared_ptr<const Policy> best_link();
std::shared_ptr<const Policy> duplicate();
std::shared_ptr<const Policy> down_sampling();
std::shared_ptr<const Policy> progressive();
std::shared_ptr<const Policy> joint();
std::shared_ptr<const Policy> placement();
std::shared_ptr<const Policy> split();
// `secure` is in interneuron/policy.h: it takes a policy of the user's.

}  // namespace interneuron::policies
