// The built-in policies, one per file; the head of each file has its whole rule. They are
// stateless, so one instance serves any number of endpoints and threads.
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
// secure() is declared in interneuron/policy.h, because it takes a policy of the user's.

}  // namespace interneuron::policies
