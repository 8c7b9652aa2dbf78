#include "core/messages/routes.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/base/water_filling.h"
#include "core/messages/arrival_forecast.h"
#include "core/wire/plain_header.h"
#include "interneuron/sizes.h"

namespace interneuron {

namespace {

// How many bytes each of the links carries: all, or its share by what is believed of it now. The
// sender divides anew, by what it knows of its queues.
std::array<std::size_t, kMaxLinks> parts_of(const Carriers& c, std::span<const LinkState> links,
                                            std::size_t bytes, Duration deadline) {
  std::array<std::size_t, kMaxLinks> parts;
  parts.fill(bytes);
  if (!c.divided) return parts;
  std::array<Way, kMaxLinks> ways;
  for (std::size_t i = 0; i < c.links.size(); ++i) {
    const LinkState& link = *std::ranges::find(links, c.links[i], &LinkState::id);
    if (link.usable_rate() == DataRate{}) return parts;
    ways[i] = {link.usable_rate(), link.rtt_p50 / 2, link.jitter};
  }
  return divide(std::span(ways).first(c.links.size()), bytes, deadline).bytes;
}

}  // namespace

std::size_t Routes::bytes(std::span<const std::size_t> sizes) const {
  std::size_t sum = 0;
  for (const Route& route : routes) sum += wire::kPlainHeaderBytes + sizes[route.variant];
  for (std::size_t v = 0; v < sizes.size(); ++v) {
    if (standing_by(v)) sum += wire::kPlainHeaderBytes + sizes[v];
  }
  return sum;
}

Routes routes_of(TimePoint now, const Peer& peer, const Plan& plan,
                 std::span<const LinkState> links, std::span<const std::size_t> sizes,
                 Duration deadline, std::uint8_t importance) {
  Routes out;
  out.outlook = {.peer = peer.identity().id, .deadline = deadline, .bytes = sizes.front()};
  const auto carriers = carriers_of(plan);
  std::uint8_t planned = 0;
  bool one_link = false;
  for (const Carriers& c : carriers) {
    if (!c.sets_out()) {
      out.shadows.push_back(c);
      continue;
    }
    planned = c.variant;
    one_link = c.links.size() == 1;
  }
  // Bytes that go before this message over each link that it may take.
  struct Ahead {
    LinkId link{};
    std::size_t bytes = 0;
  };
  Few<Ahead, kMaxLinks> queues;
  std::optional<Duration> soonest;
  for (const Carriers& c : carriers) {
    if (!c.sets_out()) continue;
    const std::uint8_t v = c.variant;
    // Where smaller variants stand by, so do those of the messages before it: they may all give
    // way.
    const bool gives_way = v == planned && one_link && v + 1U < sizes.size();
    Route route{.variant = v, .divided = c.divided, .parity = c.parity, .shadow = c.shadow};
    std::optional<Duration> slowest;
    const auto parts = parts_of(c, links, sizes[v], deadline);
    for (std::size_t i = 0; i < c.links.size(); ++i) {
      if (parts[i] == 0) {
        // It gets nothing at first, and may take over what another one is too slow for.
        route.links.push_back(c.links[i]);
        continue;
      }
      const LinkState& link = *std::ranges::find(links, c.links[i], &LinkState::id);
      if (std::ranges::find(queues, link.id, &Ahead::link) == queues.end()) {
        queues.push_back({link.id, peer.queued_before(link.id, now + deadline, importance)});
      }
      std::size_t& ahead = std::ranges::find(queues, link.id, &Ahead::link)->bytes;
      const auto expected = arrival_forecast(link, ahead, parts[i]);
      // The paths of a divided message help each other: the sender judges them together.
      const bool hopeless =
          !c.divided && is_hopeless(peer, link, gives_way ? 0 : ahead,
                                    gives_way ? sizes.back() : parts[i], deadline);
      soonest = earliest(soonest, expected);
      out.outlook.consider(link, expected, arrival_forecast(link, 0, sizes.back()), hopeless);
      if (hopeless) continue;
      if (expected) slowest = std::max(slowest.value_or(*expected), *expected);
      if (!c.divided) out.expected = earliest(out.expected, expected);
      ahead += parts[i];
      route.links.push_back(link.id);
    }
    if (c.divided) out.expected = earliest(out.expected, slowest);
    if (!route.links.empty()) out.routes.push_back(std::move(route));
  }
  if (out.routes.empty()) {
    out.expected = soonest;
    return out;
  }
  const Route& smallest = out.routes.back();
  out.last =
      smallest.links.size() == 1 ? static_cast<std::uint8_t>(sizes.size() - 1) : smallest.variant;
  return out;
}

bool is_hopeless(const Peer& peer, const LinkState& link, std::size_t ahead, std::size_t bytes,
                 Duration deadline) {
  const auto least = peer.least_time(link.id, wire_size(ahead) + wire_size(bytes));
  return least ? *least > deadline
               : cannot_arrive(link, arrival_forecast(link, ahead, bytes), deadline);
}

}  // namespace interneuron
