#include "core/plan/policies.h"

#include <algorithm>
#include <stdexcept>

#include "core/wire/round_header.h"

namespace interneuron::plan {

PolicyRegistry::PolicyRegistry(const PolicySet& policies) {
  for (const auto& policy : policies) {
    if (policy == nullptr) throw std::invalid_argument("endpoint: a policy is null");
    const std::uint32_t id = wire::policy_id(policy->name());
    // Headers name a policy by this number alone, and the other end would take one for the other.
    if (const Policy* other = find(id); other != nullptr && other->name() != policy->name()) {
      throw std::invalid_argument("endpoint: policies '" + std::string(other->name()) + "' and '" +
                                  std::string(policy->name()) + "' have one number; rename one");
    }
    entries_.push_back({id, policy});
  }
  if (entries_.empty()) throw std::invalid_argument("endpoint: no policy is registered");
}

const Policy* PolicyRegistry::find(std::string_view name) const {
  const Policy* policy = find(wire::policy_id(name));
  return policy != nullptr && policy->name() == name ? policy : nullptr;
}

const Policy* PolicyRegistry::find(std::uint32_t id) const {
  const auto it = std::ranges::find(entries_, id, &Entry::id);
  return it == entries_.end() ? nullptr : it->policy.get();
}

const Policy& PolicyRegistry::find_or_first(std::uint32_t id) const {
  const Policy* policy = find(id);
  return policy != nullptr ? *policy : *entries_.front().policy;
}

std::string PolicyRegistry::names() const {
  std::string names;
  for (const Entry& entry : entries_) {
    if (!names.empty()) names += ", ";
    names += entry.policy->name();
  }
  return names;
}

}  // namespace interneuron::plan
