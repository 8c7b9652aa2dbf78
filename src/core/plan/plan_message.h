// Which variants of a message go over which links: the policy's answer, made safe to carry out.
// Pure; throws only what the policy throws.
#pragma once

#include <span>

#include "interneuron/policy.h"

namespace interneuron {

// A result of at most kSmallResultBytes (its best variant) goes over every link that is up and that
// the policy allows, whichever policy runs; every other message as the policy plans it. The plan
// returned holds whatever the policy answers:
// - every variant is an index into offer.variant_bytes, every link is one of `links`, up and
// allowed;
// - no (variant, link) twice; the policy's order is kept otherwise;
// - sends is empty when no link is up, or when the policy names nothing that can be sent;
// under_floor is false then, and `refused` is the policy's, kNothingPlanned where it plans nothing
// and does not say why; otherwise `refused` is empty.
Plan plan_message(const Policy& policy, const Offer& offer, std::span<const LinkState> links,
                  const Guidance& guidance);

}  // namespace interneuron
