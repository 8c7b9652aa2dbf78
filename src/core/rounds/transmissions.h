// How the messages of rounds set out from here: in which mode, by which plan, with which deadline.
#pragma once

#include <optional>
#include <span>

#include "core/dispatch/dispatch.h"
#include "core/plan/policies.h"
#include "core/rounds/own_rounds.h"
#include "core/rounds/stages.h"
#include "interneuron/endpoint.h"

namespace interneuron::rounds {

// Asks the guard of a round what its next message may cost, and its policy which variants go over
// which links, and dispatches these. Owned by Rounds, whose books it reads; keeps nothing of its
// own. Pure; thread-compatible.
class Transmissions {
 public:
  // All three must outlive this.
  Transmissions(const plan::PolicyRegistry& policies, OwnRounds& own, const Stages& stages)
      : policies_(policies), own_(own), stages_(stages) {}

  // The next message of a round, as the application has it, and the links to where it goes.
  struct Next {
    std::span<const LinkState> links;
    std::span<const std::size_t> sizes;
    std::span<const VariantCost> costs;
    MessageClass message_class{};
  };
  // Decides the mode of the first transmission of a round that began here, where its guard weighs
  // the modes. What was decided before holds while neither the message nor the links have changed.
  void choose_mode(TimePoint now, RoundContext& context, const Next& next) const;
  // The plan for the next message of this context. `clock`: between the origin of the round and
  // here.
  Plan plan(TimePoint now, const RoundContext& context, const Next& next,
            const Stages::ClockOf& clock) const;
  // Plans and queues the message after the last stage of this context, and writes into the context
  // what the message tells of the round. The answer is the plan that was carried out; where it
  // holds no sends, nothing was sent. Nothing: what was planned takes more than `room` bytes, so
  // nothing was sent. The bytes of the variants that are sent are taken.
  std::optional<Planned> send(TimePoint now, peers::Peer& peer, std::size_t room,
                              RoundContext& context, const Next& next, const Stages::ClockOf& clock,
                              Variants& variants) const;

 private:
  Guidance guidance(TimePoint now, const RoundContext& context, const Stages::ClockOf& clock) const;
  Plan plan(const RoundContext& context, const Next& next, const Guidance& guidance) const;
  flow::Sender::Times times(TimePoint now, const dispatch::Round& round,
                            const Stages::ClockOf& clock) const;

  const plan::PolicyRegistry& policies_;
  OwnRounds& own_;
  const Stages& stages_;
};

}  // namespace interneuron::rounds
