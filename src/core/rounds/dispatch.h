// How a message sets out: from its variants, by the policy that its round names, to one message per
// variant on the paths that the plan gives it. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>

#include "core/peers/peer.h"
#include "core/rounds/stages.h"
#include "interneuron/endpoint.h"

namespace interneuron {

class Dispatch {
 public:
  using ClockOf = std::optional<guard::ClockView>;

  // Throws std::invalid_argument when there is no policy, or one is null.
  Dispatch(SessionId self, const PolicySet& policies);

  // Registered under this wire id, or nothing.
  const Policy* policy(std::uint32_t id) const;

  // Throws std::invalid_argument naming what is wrong with them.
  static void check(const Variants& variants);

  using Sizes = Few<std::size_t, kMaxVariants>;
  static Sizes sizes_of(const Variants& variants);

  // The plan that was carried out; without sends nothing was sent. `clock`: between the origin of
  // the round and here.
  Planned send(TimePoint now, Peer& peer, const RoundContext& context, const ClockOf& clock,
               const Variants& variants, MessageClass message_class,
               const Guidance& guidance) const;

  // The plan of a message with this header, for such an offer.
  Plan plan(std::span<const LinkState> links, const wire::RoundHeader& header, const Offer& offer,
            const Guidance& guidance) const;

 private:
  const Policy& rule(const wire::RoundHeader& header) const;
  TimePoint deadline_of(TimePoint now, const wire::RoundHeader& header, const ClockOf& clock) const;

  SessionId self_;
  std::map<std::uint32_t, std::shared_ptr<const Policy>> policies_;  // by wire id
  std::shared_ptr<const Policy> stand_in_;  // the first one, for those that are not registered
};

}  // namespace interneuron
