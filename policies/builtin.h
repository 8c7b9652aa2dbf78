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
std::shared_ptr<const Policy> coded();
std::shared_ptr<const Policy> stripe();
std::shared_ptr<const Policy> shadow();
std::shared_ptr<const Policy> failover();
std::shared_ptr<const Policy> min_rtt();
std::shared_ptr<const Policy> lowest_latency();
std::shared_ptr<const Policy> reinject();
// secure() and trusted_only() are declared in interneuron/policy.h, because they take a policy of
// the user's.

}  // namespace interneuron::policies
