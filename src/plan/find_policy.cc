#include "plan/find_policy.h"

namespace interneuron {

const Policy* find_policy(const PolicySet& policies, std::string_view name) {
  for (const auto& policy : policies) {
    if (policy && policy->name() == name) return policy.get();
  }
  return nullptr;
}

}  // namespace interneuron
