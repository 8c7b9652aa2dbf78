#include "core/guard/clock_offset.h"

namespace interneuron::guard {
namespace {

// A longer round trip than this is stale: a path is taken for dead after 4 s of silence.
constexpr Duration kMaxRoundTrip = std::chrono::seconds(60);
// Bounds the memory, 32 KB: 10 s at 100 exchanges per second. The oldest go first.
constexpr std::size_t kMaxExchanges = 1000;

constexpr std::int64_t kMillion = 1'000'000;

}  // namespace

bool ClockOffset::contradicts(const Exchange& fresh) const {
  for (std::size_t i = 0; i < exchanges_.size(); ++i) {
    const Exchange& old = exchanges_[i];
    const std::int64_t slack = (fresh.at - old.at).count() * kMaxDriftPpm / kMillion;
    if (wrapping_sub(fresh.lo, old.hi) > slack || wrapping_sub(old.lo, fresh.hi) > slack) {
      return true;
    }
  }
  return false;
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
  if (exchanges_.size() == kMaxExchanges) exchanges_.pop_front();
  exchanges_.push_back(fresh);
  return stepped ? Update::kStepped : Update::kAccepted;
}

std::optional<ClockView> ClockOffset::view(TimePoint now) {
  prune(now);
  if (exchanges_.empty()) return std::nullopt;
  const Exchange* best = &exchanges_.front();
  for (std::size_t i = 1; i < exchanges_.size(); ++i) {
    // The newest one of equals.
    if (exchanges_[i].rtt <= best->rtt) best = &exchanges_[i];
  }
  return ClockView{wrapping_sub(best->hi, best->rtt / 2), Duration{best->rtt}};
}

std::optional<Duration> ClockOffset::hi_min(TimePoint now) {
  prune(now);
  if (exchanges_.empty()) return std::nullopt;
  std::int64_t smallest = exchanges_.front().hi;
  for (std::size_t i = 1; i < exchanges_.size(); ++i) {
    if (wrapping_sub(exchanges_[i].hi, smallest) < 0) smallest = exchanges_[i].hi;
  }
  return Duration{smallest};
}

void ClockOffset::prune(TimePoint now) {
  while (!exchanges_.empty() && exchanges_.front().at < now - kWindow) exchanges_.pop_front();
}

}  // namespace interneuron::guard
