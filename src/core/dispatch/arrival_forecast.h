// When a message that is sent now should be at the other end. Pure.
#pragma once

#include <cstddef>
#include <optional>

#include "interneuron/link.h"
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

}  // namespace interneuron::dispatch
