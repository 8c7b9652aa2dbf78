// The policies that are registered at an endpoint.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/policy.h"

namespace interneuron::plan {

// Finds a policy by its name, which applications and configurations give, or by the id that stands
// for the name in the headers of rounds (wire::policy_id()). Endpoint owns one and lends it to
// whatever plans or merges messages. A peer may name any id in a header: an id that nobody
// registered is simply not found. Where two policies have one name, the first one counts.
// Immutable; pure; thread-compatible.
class PolicyRegistry {
 public:
  // Throws std::invalid_argument when there is no policy, or one is null.
  explicit PolicyRegistry(const PolicySet& policies);

  // The policy of this name, or of this id; nullptr where none is registered.
  const Policy* find(std::string_view name) const;
  const Policy* find(std::uint32_t id) const;
  // The policy of this id, or else the one that was registered first: a node of a pipeline has to
  // send on what it was given, even where the origin's policy is unknown to it.
  const Policy& find_or_first(std::uint32_t id) const;
  // "best_link, duplicate, …", in the order of their registration.
  std::string names() const;

 private:
  struct Entry {
    std::uint32_t id = 0;
    std::shared_ptr<const Policy> policy;
  };
  std::vector<Entry> entries_;
};

}  // namespace interneuron::plan
