// secure(inner, floor): another policy, over links whose security score reaches a floor alone.
//
// The score (docs/paper.md, "Nature") is 0.5 for encrypted packets or a network that the operator
// trusts (LinkTraits::trusted), 1 for both. So a floor of 0.5 keeps a message from leaving in the
// clear over a foreign network, and one of 1 keeps even its encrypted packets off it.
//
//   some link that is up reaches the floor    as the inner policy plans over those
//   none does                                 nothing (kInsecure), small results neither
//
// Results, degraded messages and lost pieces that are sent again obey the floor too. Each node
// looks at its own links: the roadside must declare its networks as well, else the result does not
// leave it. What the floor cannot reach: a node that does not have this policy under its name plans
// with the first one it has, over any link; so register it at every node of the pipeline.
//
// Receiver: as the inner policy.
#include <algorithm>
#include <stdexcept>
#include <string>

#include "policies/builtin.h"

namespace interneuron {
namespace {

class Secure final : public Policy {
 public:
  Secure(std::shared_ptr<const Policy> inner, double floor, std::string_view name)
      : inner_(std::move(inner)), floor_(floor), name_(name) {}

  std::string_view name() const override { return name_; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    Links allowed;
    for (const LinkState& link : links) {
      if (allows(link)) allowed.push_back(link);
    }
    if (std::ranges::any_of(allowed, &LinkState::up)) {
      return inner_->plan(offer, allowed, guidance);
    }
    Plan refusal;
    if (std::ranges::any_of(links, &LinkState::up)) refusal.refused = kInsecure;
    return refusal;
  }

  Merge merge(const Arrival& arrival) const override { return inner_->merge(arrival); }

  bool allows(const LinkState& link) const override {
    return link.nature.security >= floor_ && inner_->allows(link);
  }

 private:
  std::shared_ptr<const Policy> inner_;
  double floor_;
  std::string name_;
};

}  // namespace

std::shared_ptr<const Policy> secure(std::shared_ptr<const Policy> inner, double floor,
                                     std::string_view name) {
  if (inner == nullptr) throw std::invalid_argument("secure: no policy is given");
  if (!(floor > 0 && floor <= 1)) {
    throw std::invalid_argument("secure: the floor must be above 0 and at most 1");
  }
  return std::make_shared<Secure>(std::move(inner), floor, name);
}

}  // namespace interneuron
