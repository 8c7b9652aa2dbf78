// How a message sets out: the policy that its round names plans which of its variants go over which
// paths, and each of those is queued at the peer with a header of its own. Dispatch holds the
// policies and nothing that changes; used by Rounds. Pure; thread-compatible.
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
  // The clock between the origin of a round and here.
  using ClockOf = std::optional<guard::ClockView>;

  // Throws std::invalid_argument when there is no policy, or one is null.
  // `longest_deadline`: no deadline of another origin is believed to be longer.
  Dispatch(SessionId self, const PolicySet& policies, Duration longest_deadline);

  // The policy that is registered under this id of headers, else nullptr.
  const Policy* policy(std::uint32_t id) const;

  // Throws std::invalid_argument where there are none, too many, or one is too large.
  static void check(const Variants& variants);

  using Sizes = Few<std::size_t, kMaxVariants>;
  static Sizes sizes_of(const Variants& variants);

  // Plans and queues the message after the last stage of this context. The answer is the plan that
  // was carried out; where it holds no sends, nothing was sent. Nothing: what was planned takes
  // more than `room` bytes, so nothing was sent. The bytes of the variants that are sent are taken.
  std::optional<Planned> send(TimePoint now, Peer& peer, std::size_t room,
                              const RoundContext& context, const ClockOf& clock, Variants& variants,
                              MessageClass message_class, const Guidance& guidance) const;

  // The plan for a message with this header and offer.
  Plan plan(std::span<const LinkState> links, const wire::RoundHeader& header, const Offer& offer,
            const Guidance& guidance) const;

 private:
  const Policy& rule(const wire::RoundHeader& header) const;
  TimePoint deadline_of(TimePoint now, const wire::RoundHeader& header, const ClockOf& clock) const;

  // What is believed of the deadline that a header states.
  Duration believed(const wire::RoundHeader& header) const;

  SessionId self_;
  Duration longest_deadline_;
  // By the id that headers carry.
  std::map<std::uint32_t, std::shared_ptr<const Policy>> policies_;
  // Plans for rounds whose policy is not registered here: the first one of all.
  std::shared_ptr<const Policy> stand_in_;
};

}  // namespace interneuron
