#include "lab/emu/channel.h"

#include <algorithm>
#include <utility>

namespace interneuron::emu {

Channel::Channel(std::shared_ptr<DelayProcess> process, const PeriodicOutage& outages,
                 const NatParams& nat)
    : process_(std::move(process)), periodic_(outages), nat_(nat) {}

Channel::Sample Channel::at(Duration t) {
  const DelayProcess::Sample sample = process_->at(t - origin_);
  return {fixed_rtt_.value_or(sample.rtt) / 2, sample.loss, sample.out || in_outage(t)};
}

void Channel::replace(Duration now, std::shared_ptr<DelayProcess> process,
                      const PeriodicOutage& outages, const NatParams& nat) {
  process_ = std::move(process);
  origin_ = now;
  fixed_rtt_.reset();
  periodic_ = outages;
  nat_ = nat;
}

void Channel::add_outage(Duration from, Duration length) {
  if (length <= Duration{}) return;
  Interval added{from, from + length};
  const auto begin = std::partition_point(outages_.begin(), outages_.end(),
                                          [&](const Interval& i) { return i.to < added.from; });
  const auto end = std::partition_point(begin, outages_.end(),
                                        [&](const Interval& i) { return i.from <= added.to; });
  if (begin != end) {
    added.from = std::min(added.from, begin->from);
    added.to = std::max(added.to, std::prev(end)->to);
  }
  outages_.insert(outages_.erase(begin, end), added);
}

bool Channel::mapping_lost(Duration now) const {
  return nat_.idle_timeout > Duration{} && (!last_up_ || now - *last_up_ > nat_.idle_timeout);
}

Duration Channel::awake(Duration now, Duration wake_after, Duration wake_by) {
  const bool slept = !last_packet_ || now - *last_packet_ > wake_after;
  if (slept && wake_by > Duration{}) awake_at_ = now + wake_by;
  last_packet_ = now;
  return std::max(now, awake_at_);
}

bool Channel::in_outage(Duration t) const {
  if (!outages_.empty()) {
    const auto after = std::partition_point(outages_.begin(), outages_.end(),
                                            [&](const Interval& i) { return i.from <= t; });
    if (after != outages_.begin() && t < std::prev(after)->to) return true;
  }
  Duration since = t - origin_ - periodic_.first;
  if (periodic_.length <= Duration{} || since < Duration{}) return false;
  if (periodic_.every > Duration{}) since %= periodic_.every;
  return since < periodic_.length;
}

}  // namespace interneuron::emu
