// Which variants of a message go over which links: the policy's answer, made safe to carry out.
// Pure; throws only what the policy throws.
#pragma once

#include <span>

#include "interneuron/policy.h"

namespace interneuron::plan {

// A result whose best variant has at most kSmallResultBytes goes over every link that is up and
// that the policy allows, whichever policy runs; over a slow one where a copy is cheap, or where
// none is and no other link brings it sooner. Every other message goes as the policy plans it.
// Whatever the policy answers, the plan returned keeps these promises:
//
// - each variant is an index into offer.variant_bytes, each link is one of `links`, up and allowed;
// - no variant is sent twice over the same link in one role; the policy's order is kept. A variant
//   has whole copies or shares: shares beside whole copies are left out;
// - repair symbols are those of variants that set out, and some variant sets out;
// - `sends` is empty when no link is up or when the policy names nothing that can be sent; then
//   `under_floor` is false and `refused` is the policy's reason, or kNothingPlanned if it plans
//   nothing and gives none; otherwise `refused` is empty.
//
// Where the plan of a plain message (one without a period) rests on links that are suspected of
// having fallen silent, and the policy plans as good a variant without them that is there in time,
// that plan is carried out instead.
Plan plan_message(const Policy& policy, const Offer& offer, std::span<const LinkState> links,
                  const Guidance& guidance);

// The rate of a link that could carry a message of so many bytes: the floor that policies ask for,
// or what brings it within half of its deadline, as the other half may go by on the way, in queues
// and, in a round, on the way back.
DataRate rate_wanted(const QoS& qos, std::size_t bytes);

}  // namespace interneuron::plan
