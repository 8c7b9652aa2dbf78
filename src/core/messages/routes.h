// Which variants of a plain message set out over which links, which stand by, and when the first
// should be there. Pure.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/messages/on_time_forecast.h"
#include "core/peers/peer.h"
#include "core/plan/carriers.h"
#include "interneuron/few.h"
#include "interneuron/link.h"
#include "interneuron/policy.h"

namespace interneuron {

// A variant that sets out, and over which links; at least one. The roles of the others are those of
// Carriers.
struct Route {
  std::uint8_t variant = 0;
  Few<LinkId, kMaxLinks> links{};
  bool divided = false;
  Few<LinkId, kMaxLinks> parity{};
  Few<LinkId, kMaxLinks> shadow{};
};

// What is left of a plan when the transmissions are taken out that cannot arrive. Plain values.
struct Routes {
  // In the order of variants; empty where nothing can arrive in time.
  std::vector<Route> routes;
  // The variants after that of the last route up to this one stand by: the next of them takes the
  // place of one that its link gives up. None does where the last route has several links.
  std::uint8_t last = 0;
  // The variants that the plan has stand by over links of their own (SendRole::kShadow).
  std::vector<Carriers> shadows;
  // When the first of the variants should be there, from now; nothing where no link is measured.
  std::optional<Duration> expected;
  // What its chances are judged by, and what they are.
  Outlook outlook;
  double on_time = 0;

  // What the variants that set out or stand by take, with their headers.
  std::size_t bytes(std::span<const std::size_t> sizes) const;
  bool standing_by(std::size_t variant) const {
    return variant > routes.back().variant &&
           (variant <= last ||
            std::ranges::find(shadows, variant, &Carriers::variant) != shadows.end());
  }
  flow::PathSet shadow_of(std::size_t variant) const {
    const auto it = std::ranges::find(shadows, variant, &Carriers::variant);
    return it == shadows.end() ? flow::PathSet{} : flow::PathSet::of(it->shadow);
  }
};

// The links of the plan are among `links`; `sizes` are those of the variants, in bytes. Variants
// leave in their order, so that each waits for those before it on the same link.
Routes routes_of(TimePoint now, const Peer& peer, const Plan& plan,
                 std::span<const LinkState> links, std::span<const std::size_t> sizes,
                 Duration deadline, std::uint8_t importance);

// Whether so many bytes that are sent over this link now, behind `ahead` others, are sure to be
// late. Over a path that is loaded the sender knows that better, by what is in flight and by the
// share that it may come to soon: what it would send must not be refused.
bool is_hopeless(const Peer& peer, const LinkState& link, std::size_t ahead, std::size_t bytes,
                 Duration deadline);

}  // namespace interneuron
