#include "core/messages/routes.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/base/water_filling.h"
#include "core/messages/arrival_forecast.h"
#include "interneuron/sizes.h"

namespace interneuron {

namespace {

// Whether so many bytes that are sent over this link now, behind `ahead` others, are sure to be
// late. Over a path that is loaded the sender knows that better, by what is in flight and by the
// share that it may come to soon: what it would send must not be refused.
bool is_hopeless(const Peer& peer, const LinkState& link, std::size_t ahead, std::size_t bytes,
                 Duration deadline) {
  const auto least = peer.least_time(link.id, wire_size(ahead) + wire_size(bytes));
  return least ? *least > deadline
               : cannot_arrive(link, arrival_forecast(link, ahead, bytes), deadline);
}

// How many bytes each of the links carries: all, or its share by what is believed of it now. The
// sender divides anew, by what it knows of its queues.
std::array<std::size_t, kMaxLinks> parts_of(const Carriers& c, std::span<const LinkState> links,
                                            std::size_t bytes, Duration deadline) {
  std::array<std::size_t, kMaxLinks> parts;
  parts.fill(bytes);
  if (!c.helpers.divided) return parts;
  std::array<Way, kMaxLinks> ways;
  for (std::size_t i = 0; i < c.links.size(); ++i) {
    const LinkState& link = *std::ranges::find(links, c.links[i], &LinkState::id);
    if (link.usable_rate() == DataRate{}) return parts;
    ways[i] = {link.usable_rate(), link.rtt_p50 / 2, link.jitter};
  }
  return divide(std::span(ways).first(c.links.size()), bytes, deadline).bytes;
}

// Takes the variants of a plan, from the best on, and leaves out the links that bring one too late.
class Sieve {
 public:
  Sieve(TimePoint now, const Peer& peer, std::span<const LinkState> links,
        std::span<const std::size_t> sizes, Duration deadline, std::uint8_t importance)
      : peer_(peer),
        links_(links),
        sizes_(sizes),
        deadline_(deadline),
        ends_(now + deadline),
        importance_(importance) {
    out_.outlook = {
        .peer = peer.identity().id, .at = now, .deadline = deadline, .bytes = sizes.front()};
  }

  // `gives_way`: smaller variants stand by for this one.
  void take(const Carriers& c, bool gives_way) {
    Carriers kept{.variant = c.variant, .helpers = c.helpers};
    std::optional<Duration> last_part;
    const auto parts = parts_of(c, links_, sizes_[c.variant], deadline_);
    for (std::size_t i = 0; i < c.links.size(); ++i) {
      // A link that gets nothing at first may take over what another one is too slow for.
      if (parts[i] > 0 && !judge(c, c.links[i], parts[i], gives_way, last_part)) continue;
      kept.links.push_back(c.links[i]);
    }
    if (c.helpers.divided) out_.expected = earliest(out_.expected, last_part);
    if (kept.sets_out()) out_.itinerary.push_back(kept);
  }

  // What the plan has stand by, and what may stand by beside that.
  Routes finish(const Itinerary& planned) {
    Itinerary& kept = out_.itinerary;
    if (kept.empty()) out_.expected = soonest_;
    if (kept.empty()) return out_;
    const bool has_one_link = kept.back().links.size() == 1;
    for (std::size_t v = kept.back().variant + 1U; v < sizes_.size(); ++v) {
      if (const Carriers* own = planned.stand_by(v)) {
        kept.push_back(*own);
      } else if (has_one_link) {
        kept.push_back({.variant = static_cast<std::uint8_t>(v)});
      }
    }
    return out_;
  }

 private:
  // Whether this link brings so many bytes of a variant in time, and when.
  bool judge(const Carriers& c, LinkId id, std::size_t bytes, bool gives_way,
             std::optional<Duration>& last_part) {
    const LinkState& link = *std::ranges::find(links_, id, &LinkState::id);
    std::size_t& before = ahead(id);
    const auto expected = arrival_forecast(link, before, bytes);
    // The paths of a divided message help each other: the sender judges them together. And where
    // smaller variants stand by, so do those of the messages before it: they may all give way.
    const bool hopeless =
        !c.helpers.divided && is_hopeless(peer_, link, gives_way ? 0 : before,
                                          gives_way ? sizes_.back() : bytes, deadline_);
    soonest_ = earliest(soonest_, expected);
    out_.outlook.consider(link, expected, arrival_forecast(link, 0, sizes_.back()), hopeless);
    if (hopeless) return false;
    if (expected) last_part = std::max(last_part.value_or(*expected), *expected);
    if (!c.helpers.divided) out_.expected = earliest(out_.expected, expected);
    before += bytes;
    return true;
  }

  // The bytes that leave before the next variant over this link: those of other messages, and of
  // better variants of this one.
  std::size_t& ahead(LinkId link) {
    const auto it = std::ranges::find(queues_, link, &Queue::link);
    if (it != queues_.end()) return it->bytes;
    queues_.push_back({link, peer_.queued_before(link, ends_, importance_)});
    return queues_.back().bytes;
  }

  struct Queue {
    LinkId link{};
    std::size_t bytes = 0;
  };
  const Peer& peer_;
  std::span<const LinkState> links_;
  std::span<const std::size_t> sizes_;
  Duration deadline_;
  TimePoint ends_;
  std::uint8_t importance_;
  Few<Queue, kMaxLinks> queues_;
  Routes out_;
  // The first of all transmissions, also of those that are left out.
  std::optional<Duration> soonest_;
};

}  // namespace

Routes routes_of(TimePoint now, const Peer& peer, const Itinerary& planned,
                 std::span<const LinkState> links, std::span<const std::size_t> sizes,
                 Duration deadline, std::uint8_t importance) {
  Sieve sieve(now, peer, links, sizes, deadline, importance);
  const Carriers* last = planned.last_to_set_out();
  for (const Carriers& c : planned) {
    const bool gives_way = &c == last && c.links.size() == 1 && c.variant + 1U < sizes.size();
    if (c.sets_out()) sieve.take(c, gives_way);
  }
  return sieve.finish(planned);
}

}  // namespace interneuron
