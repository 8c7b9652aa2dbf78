// Which variants of a plain message can arrive in time over which links, and when the first should
// be there. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/dispatch/dispatch.h"
#include "core/peers/peer.h"
#include "interneuron/link.h"
#include "interneuron/send.h"
#include "interneuron/units.h"

namespace interneuron::dispatch {

// From now until the last byte of a message is at the other end of this link, by what is believed
// of it: half the smallest round trip, the queue in the network, what our own sender sends before
// it (`ahead`, bytes of messages) and its own bytes at our share of the link's rate. Without a rate
// the bytes take no time; nothing while the delay was not measured.
std::optional<Duration> arrival_forecast(const LinkState& link, std::size_t ahead,
                                         std::size_t bytes);

// Whether a message that is expected after `expected` is to be refused at once: where it misses
// the deadline by more than the link's delay varies. One that is not expected at all is sent.
bool cannot_arrive(const LinkState& link, std::optional<Duration> expected, Duration deadline);

// What is left of a plan when the transmissions are taken out that cannot arrive. Plain values.
struct Routes {
  // What sets out and, behind it, what stands by for the last of it; empty where nothing can arrive
  // in time.
  Itinerary itinerary;
  // When the first of the variants should be there, from now; nothing where no link is measured.
  std::optional<Duration> expected;
  // The transmission that is expected first: of those that are kept, or of all while none is.
  // Nothing where the plan has no link that carries anything.
  struct First {
    LinkId link{};
    bool is_hopeless = false;
    std::optional<Duration> expected;
    // When the smallest variant would be there over this link if nothing went before it.
    std::optional<Duration> least;
  };
  std::optional<First> first;
};

// The links to a peer, where what waits here for a slow one counts as a queue of that link.
Links links_behind_queue(TimePoint now, const peers::Peer& peer);

// Judges each transmission of a plan, in the order of the variants, so that each waits for those
// before it on the same link. The links of the plan are among `links`; `sizes` are those of the
// variants, in bytes, and `allowed` the links that the policy allows.
//
// Where nothing of a plan is expected in time, its last variant takes another link that is, and
// where there is none, whatever may be in time were the link as fast as it has been lately and
// empty: the rate of a radio doubles within a second, only what is sent tells, and the sender gives
// up what has not left when it cannot arrive any more. Nothing is kept where even that is too late.
//
// Smaller variants stand by for the last one that sets out: those that the plan has stand by over
// links of their own, and all of them where it has one link, which may give it up.
Routes routes_of(TimePoint now, const peers::Peer& peer, const Itinerary& planned,
                 const flow::PathSet& allowed, std::span<const LinkState> links,
                 std::span<const std::size_t> sizes, const SendOptions& options);

}  // namespace interneuron::dispatch
