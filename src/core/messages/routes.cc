#include "core/messages/routes.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/messages/arrival_forecast.h"
#include "core/wire/plain_header.h"
#include "interneuron/sizes.h"

namespace interneuron {

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
  out.outlook = {
      .peer = peer.identity().id, .at = now, .deadline = deadline, .bytes = sizes.front()};
  const std::uint8_t planned = std::ranges::max(plan.sends, {}, &Assignment::variant).variant;
  const bool one_link = std::ranges::count(plan.sends, planned, &Assignment::variant) == 1;
  // Bytes that go before this message over each link that it may take.
  struct Ahead {
    LinkId link{};
    std::size_t bytes = 0;
  };
  Few<Ahead, kMaxLinks> queues;
  std::optional<Duration> soonest;
  for (std::uint8_t v = 0; v < sizes.size(); ++v) {
    // Where smaller variants stand by, so do those of the messages before it: they may all give
    // way.
    const bool gives_way = v == planned && one_link && v + 1U < sizes.size();
    Route route{v, {}};
    for (const Assignment& send : plan.sends) {
      if (send.variant != v) continue;
      const LinkState& link = *std::ranges::find(links, send.link, &LinkState::id);
      if (std::ranges::find(queues, send.link, &Ahead::link) == queues.end()) {
        queues.push_back({send.link, peer.queued_before(send.link, now + deadline, importance)});
      }
      std::size_t& ahead = std::ranges::find(queues, send.link, &Ahead::link)->bytes;
      const auto expected = arrival_forecast(link, ahead, sizes[v]);
      soonest = earliest(soonest, expected);
      const bool hopeless = is_hopeless(peer, link, gives_way ? 0 : ahead,
                                        gives_way ? sizes.back() : sizes[v], deadline);
      out.outlook.consider(link, expected, arrival_forecast(link, 0, sizes.back()), hopeless);
      if (hopeless) continue;
      out.expected = earliest(out.expected, expected);
      ahead += sizes[v];
      route.links.push_back(send.link);
    }
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
