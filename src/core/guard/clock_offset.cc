#include "core/guard/clock_offset.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

// A longer round trip than this is stale: a path is taken for dead after 4 s of silence.
constexpr Duration kMaxRoundTrip = std::chrono::seconds(60);
// Bounds the memory, 32 KB: 10 s at 100 exchanges per second of which each tells something that
// none after it does. The oldest go first.
constexpr std::size_t kMaxExchanges = 1000;

constexpr std::int64_t kMillion = 1'000'000;

}  // namespace

bool ClockOffset::contradicts(const Exchange& fresh) const {
  return std::ranges::any_of(exchanges_, [&fresh](const Exchange& old) {
    const std::int64_t slack = (fresh.at - old.at).count() * kMaxDriftPpm / kMillion;
    return wrapping_sub(fresh.lo, old.hi) > slack || wrapping_sub(old.lo, fresh.hi) > slack;
  });
}

ClockOffset::Update ClockOffset::add(TimePoint r, PeerTime u, TimePoint s, Duration h) {
  const std::int64_t r_ns = r.time_since_epoch().count();
  const std::int64_t u_ns = u.time_since_epoch().count();
  const std::int64_t s_ns = s.time_since_epoch().count();
  const std::int64_t away = wrapping_sub(r_ns, s_ns);
  const std::int64_t rtt = wrapping_sub(away, h.count());
  if (away < 0 || h.count() < 0 || rtt < 0 || rtt > kMaxRoundTrip.count()) return Update::kRejected;

  prune(r);
  const Exchange fresh{r, wrapping_sub(r_ns, u_ns),
                       wrapping_sub(s_ns, wrapping_sub(u_ns, h.count())), rtt};
  const bool stepped = contradicts(fresh);
  if (stepped) exchanges_.clear();
  // What bounds α from further away on both sides has no smaller round trip, and contradicts
  // nothing that the fresh one, of which less drift is allowed for, does not.
  std::erase_if(exchanges_, [&fresh](const Exchange& old) {
    return wrapping_sub(fresh.hi, old.hi) <= 0 && wrapping_sub(fresh.lo, old.lo) >= 0;
  });
  if (exchanges_.size() == kMaxExchanges) exchanges_.erase(exchanges_.begin());
  exchanges_.push_back(fresh);
  return stepped ? Update::kStepped : Update::kAccepted;
}

std::optional<ClockView> ClockOffset::view(TimePoint now) {
  prune(now);
  if (exchanges_.empty()) return std::nullopt;
  const Exchange* best = &exchanges_.front();
  for (const Exchange& exchange : exchanges_) {
    // The newest one of equals.
    if (exchange.rtt <= best->rtt) best = &exchange;
  }
  return ClockView{wrapping_sub(best->hi, best->rtt / 2), Duration{best->rtt}};
}

std::optional<Duration> ClockOffset::hi_min(TimePoint now) {
  prune(now);
  if (exchanges_.empty()) return std::nullopt;
  std::int64_t smallest = exchanges_.front().hi;
  for (const Exchange& exchange : exchanges_) {
    if (wrapping_sub(exchange.hi, smallest) < 0) smallest = exchange.hi;
  }
  return Duration{smallest};
}

void ClockOffset::prune(TimePoint now) {
  const auto young = std::ranges::find_if(
      exchanges_, [now](const Exchange& exchange) { return exchange.at >= now - kWindow; });
  exchanges_.erase(exchanges_.begin(), young);
}

}  // namespace interneuron::guard
