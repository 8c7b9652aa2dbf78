#include "core/dispatch/routes.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/base/slow_link.h"
#include "core/base/water_filling.h"
#include "interneuron/sizes.h"

namespace interneuron::dispatch {

namespace {

// Whether so many bytes that are sent over this link now, behind `ahead` others, are sure to be
// late. Over a path that is loaded the sender knows that better, by what is in flight and by the
// share that it may come to soon: what it would send must not be refused.
bool is_hopeless(const peers::Peer& peer, const LinkState& link, std::size_t ahead,
                 std::size_t bytes, Duration deadline) {
  const auto least = peer.sender().least_time(link.id, wire_size(ahead) + wire_size(bytes));
  return least ? *least > deadline
               : cannot_arrive(link, arrival_forecast(link, ahead, bytes), deadline);
}

// What a link must look like to be sent over: as if it brings the message in time, or else as if it
// may do so yet, were it as fast as it has been and empty.
enum class Bar { kBelieved, kPossible };

// How many bytes each of the links carries: all, or its share by what is believed of it now. The
// sender divides anew, by what it knows of its queues.
std::array<std::size_t, kMaxLinks> parts_of(const Carriers& c, std::span<const LinkState> links,
                                            std::size_t bytes, Duration deadline) {
  std::array<std::size_t, kMaxLinks> parts;
  parts.fill(bytes);
  if (!c.protection.divided) return parts;
  std::array<Way, kMaxLinks> ways;
  for (std::size_t i = 0; i < c.links.size(); ++i) {
    const LinkState& link = *std::ranges::find(links, c.links[i], &LinkState::id);
    if (link.usable_rate() == DataRate{}) return parts;
    ways[i] = {link.usable_rate(), link.rtt_p50 / 2, link.jitter};
  }
  return divide(std::span(ways).first(c.links.size()), bytes, deadline).bytes;
}

// Takes the variants of a plan, from the best on, and leaves out the links that bring one too late.
struct Sieve {
  TimePoint now{};
  const peers::Peer& peer;
  std::span<const LinkState> links;
  std::span<const std::size_t> sizes;
  const SendOptions& options;
  Routes out{};
  // When the first of all transmissions should be there, also of those that are left out.
  std::optional<Duration> soonest{};
  struct Queue {
    LinkId link{};
    std::size_t bytes = 0;
  };
  Few<Queue, kMaxLinks> queues{};
  Bar bar = Bar::kBelieved;

  // The bytes that leave before the next variant over this link: those of other messages, and of
  // better variants of this one.
  std::size_t& ahead(LinkId link) {
    const auto it = std::ranges::find(queues, link, &Queue::link);
    if (it != queues.end()) return it->bytes;
    queues.push_back(
        {link, peer.sender().queued_before(link, now + options.deadline, importance_of(options))});
    return queues.back().bytes;
  }

  // How long so many bytes take over this link, as far as the bar asks; no time where nothing is
  // known of it.
  Duration takes(const LinkState& link, std::size_t bytes) {
    if (bar == Bar::kPossible) return peer.sender().possible_time(now, link.id, wire_size(bytes));
    return arrival_forecast(link, ahead(link.id), bytes).value_or(Duration::zero());
  }

  void consider(const Routes::First& way) {
    const auto& known = out.first;
    const bool sooner =
        way.expected && (!known || !known->expected || *way.expected < *known->expected);
    const bool is_better =
        known && known->is_hopeless != way.is_hopeless ? !way.is_hopeless : sooner;
    if (!known || is_better) out.first = way;
  }

  // Whether this link brings `bytes` of a variant in time. Where smaller variants stand by for it
  // (`gives_way`), so do those of the messages before it, and they may all give way.
  bool judge(const Carriers& c, LinkId id, std::size_t bytes, bool gives_way,
             std::optional<Duration>& last_part) {
    const LinkState& link = *std::ranges::find(links, id, &LinkState::id);
    std::size_t& before = ahead(id);
    const auto expected = arrival_forecast(link, before, bytes);
    // The paths of a divided message help each other: the sender judges them together.
    const bool hopeless = !c.protection.divided &&
                          (gives_way ? is_hopeless(peer, link, 0, sizes.back(), options.deadline)
                                     : is_hopeless(peer, link, before, bytes, options.deadline));
    soonest = earliest(soonest, expected);
    consider({id, hopeless, expected, arrival_forecast(link, 0, sizes.back())});
    const std::size_t least = gives_way ? sizes.back() : bytes;
    const bool refused = bar == Bar::kBelieved ? hopeless : takes(link, least) > options.deadline;
    if (refused) return false;
    if (expected) last_part = std::max(last_part.value_or(*expected), *expected);
    if (!c.protection.divided) out.expected = earliest(out.expected, expected);
    before += bytes;
    return true;
  }

  void take(const Carriers& c, bool gives_way) {
    Carriers kept{.variant = c.variant, .protection = c.protection};
    std::optional<Duration> last_part;
    const auto parts = parts_of(c, links, sizes[c.variant], options.deadline);
    for (std::size_t i = 0; i < c.links.size(); ++i) {
      // A link that gets nothing at first may take over what another one is too slow for.
      if (parts[i] > 0 && !judge(c, c.links[i], parts[i], gives_way, last_part)) continue;
      kept.links.push_back(c.links[i]);
    }
    if (c.protection.divided) out.expected = earliest(out.expected, last_part);
    if (kept.sets_out()) out.itinerary.push_back(kept);
  }
};

// The variants that set out by the plan. Where nothing would be in time over its links, the last of
// them over the soonest of the others that the policy allows.
void send(Sieve& sieve, const Itinerary& planned, const flow::PathSet& allowed) {
  const auto sets_out = [](const Carriers& c) { return c.sets_out(); };
  Carriers elsewhere;
  for (const Carriers& c : planned) {
    const bool is_last = std::none_of(&c + 1, planned.end(), sets_out);
    const bool gives_way = is_last && c.links.size() == 1 && c.variant + 1U < sieve.sizes.size();
    if (!c.sets_out()) continue;
    sieve.take(c, gives_way);
    elsewhere = {.variant = c.variant, .protection = c.protection};
  }
  elsewhere.protection.divided = false;
  std::optional<Duration> soonest;
  for (const LinkState& link : sieve.links) {
    if (!link.up || !allowed.contains(link.id)) continue;
    const Duration takes = sieve.takes(link, sieve.sizes[elsewhere.variant]);
    if (soonest && takes >= *soonest) continue;
    soonest = takes;
    elsewhere.links = {};
    elsewhere.links.push_back(link.id);
  }
  if (sieve.out.itinerary.empty() && elsewhere.sets_out()) sieve.take(elsewhere, false);
}

// Smaller variants stand by for the last one that is kept.
void add_stand_bys(Itinerary& kept, const Itinerary& planned, std::size_t variants) {
  const bool has_one_link = kept.back().links.size() == 1;
  for (std::size_t v = kept.back().variant + 1U; v < variants; ++v) {
    const auto* own = std::ranges::find_if(
        planned, [v](const Carriers& c) { return c.variant == v && !c.sets_out(); });
    if (own != planned.end()) {
      kept.push_back(*own);
    } else if (has_one_link) {
      kept.push_back({.variant = static_cast<std::uint8_t>(v)});
    }
  }
}

}  // namespace

Links links_behind_queue(TimePoint now, const peers::Peer& peer) {
  Links out = peer.links(now);
  for (LinkState& link : out) {
    if (!is_slow(link.rate)) continue;
    const std::size_t bytes =
        peer.sender().queued_before(link.id, TimePoint::max(), flow::kUsualImportance);
    link.queue_up += link.usable_rate().transmit_time(bytes);
  }
  return out;
}

Routes routes_of(TimePoint now, const peers::Peer& peer, const Itinerary& planned,
                 const flow::PathSet& allowed, std::span<const LinkState> links,
                 std::span<const std::size_t> sizes, const SendOptions& options) {
  Sieve sieve{now, peer, links, sizes, options};
  Routes& out = sieve.out;
  send(sieve, planned, allowed);
  if (out.itinerary.empty()) {
    sieve.bar = Bar::kPossible;
    send(sieve, planned, allowed);
  }
  if (out.itinerary.empty()) {
    out.expected = sieve.soonest;
  } else {
    add_stand_bys(out.itinerary, planned, sizes.size());
  }
  return out;
}

}  // namespace interneuron::dispatch
