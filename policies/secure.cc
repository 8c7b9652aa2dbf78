// secure(inner, floor) and trusted_only(inner): another policy, over some of the links alone.
//
// secure() takes the links whose security score reaches a floor. The score (docs/paper.md,
// "Nature") is 0.5 for encrypted packets or a network that the operator trusts
// (LinkTraits::trusted), 1 for both. So a floor of 0.5 keeps a message from leaving in the clear
// over a foreign network, and one of 1 keeps even its encrypted packets off it. trusted_only()
// takes the links of networks that the operator trusts, encrypted or not.
//
//   some link that is up may be used    as the inner policy plans over those
//   none may                            nothing (kInsecure, kUntrusted), small results neither
//
// Results, degraded messages and lost pieces that are sent again obey this too. Each node looks at
// its own links: the roadside must declare its networks as well, else the result does not leave it.
// What a policy cannot reach: a node that does not have it under its name plans with the first one
// it has, over any link; so register it at every node of the pipeline.
//
// Receiver: as the inner policy.
#include "interneuron/policy.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace interneuron {
namespace {

// Which links may be used, and what is said where none may.
struct Condition {
  double floor = 0;  // of the security score
  bool trusted = false;
  std::string_view refusal;
};

class Restricted final : public Policy {
 public:
  Restricted(std::shared_ptr<const Policy> inner, Condition condition, std::string_view name)
      : inner_(std::move(inner)), condition_(condition), name_(name) {
    if (inner_ == nullptr) throw std::invalid_argument(name_ + ": no policy is given");
  }

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
    if (std::ranges::any_of(links, &LinkState::up)) refusal.refused = condition_.refusal;
    return refusal;
  }

  Merge merge(const Arrival& arrival) const override { return inner_->merge(arrival); }

  bool allows(const LinkState& link) const override {
    const bool trusted = link.traits.trusted || !condition_.trusted;
    return trusted && link.nature.security >= condition_.floor && inner_->allows(link);
  }

 private:
  std::shared_ptr<const Policy> inner_;
  Condition condition_;
  std::string name_;
};

}  // namespace

std::shared_ptr<const Policy> secure(std::shared_ptr<const Policy> inner, double floor,
                                     std::string_view name) {
  if (!(floor > 0 && floor <= 1)) {
    throw std::invalid_argument("secure: the floor must be above 0 and at most 1");
  }
  return std::make_shared<Restricted>(std::move(inner),
                                      Condition{.floor = floor, .refusal = kInsecure}, name);
}

std::shared_ptr<const Policy> trusted_only(std::shared_ptr<const Policy> inner,
                                           std::string_view name) {
  return std::make_shared<Restricted>(std::move(inner),
                                      Condition{.trusted = true, .refusal = kUntrusted}, name);
}

}  // namespace interneuron
