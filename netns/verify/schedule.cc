#include "netns/verify/schedule.h"

#include <algorithm>

namespace interneuron::netns::verify {

namespace {

double loss_of(Direction direction, const ScheduleSample& sample) {
  return direction == Direction::kUp ? sample.loss_up : sample.loss_down;
}

DataRate rate_of(Direction direction, const ScheduleSample& sample) {
  return direction == Direction::kUp ? sample.rate_up : sample.rate_down;
}

}  // namespace

bool Schedule::covers(Duration from, Duration to) const {
  return !empty() && samples_.front().at <= from && to < samples_.back().at + emu::kDelayStep;
}

double Schedule::loss(Direction direction, Duration t) const { return loss_of(direction, at(t)); }

DataRate Schedule::rate(Direction direction, Duration t) const { return rate_of(direction, at(t)); }

DataRate Schedule::top_rate(Direction direction) const {
  DataRate top{};
  for (const auto& sample : samples_) top = std::max(top, rate_of(direction, sample));
  return top;
}

bool Schedule::mostly_out(Direction direction, Duration from, Duration to) const {
  std::int64_t out = 0;
  std::int64_t steps = 0;
  for (Duration t = from; t < to; t += emu::kDelayStep, ++steps) {
    if (loss(direction, t) >= 1) ++out;
  }
  return 2 * out > steps;
}

double Schedule::bits_between(Direction direction, Duration from, Duration to) const {
  double bits = 0;
  for (const auto& sample : samples_) {
    const Duration begin = std::max(from, sample.at);
    const Duration end = std::min(to, sample.at + emu::kDelayStep);
    if (end <= begin) continue;
    bits += to_seconds(end - begin) * rate_of(direction, sample).mbit() * 1e6 *
            (1 - loss_of(direction, sample));
  }
  return bits;
}

Duration Schedule::sent_by(Duration arrival) const {
  Duration latest = samples_.front().at;
  for (const auto& sample : samples_) {
    const Duration sent = arrival - sample.rtt / 2;
    if (sent < sample.at) continue;
    latest = std::max(latest, std::min(sent, sample.at + emu::kDelayStep));
  }
  return latest;
}

const ScheduleSample& Schedule::at(Duration t) const {
  const auto last = static_cast<std::int64_t>(samples_.size()) - 1;
  const std::int64_t step = (t - samples_.front().at) / emu::kDelayStep;
  return samples_[static_cast<std::size_t>(std::clamp<std::int64_t>(step, 0, last))];
}

Course::Course(const Schedule& schedule, Direction direction, std::span<const Sent> traffic)
    : schedule_(schedule), direction_(direction) {
  after_.reserve(traffic.size());
  Moment moment;
  for (const Sent& packet : traffic) {
    moment = follow(moment, packet);
    after_.push_back(moment);
  }
}

Duration Course::arrival(Duration at, std::size_t ip_bytes) const {
  const auto next = std::upper_bound(after_.begin(), after_.end(), at,
                                     [](Duration t, const Moment& m) { return t < m.at; });
  const Moment before = next == after_.begin() ? Moment{} : *(next - 1);
  return follow(before, {at, ip_bytes, false}).due;
}

Course::Moment Course::follow(const Moment& before, const Sent& packet) const {
  const Duration start = std::max(before.idle, packet.at);
  const auto rate = static_cast<double>(schedule_.rate(direction_, start).bits_per_second);
  const double on_air_ns = rate > 0 ? static_cast<double>(packet.ip_bytes) * 8e9 / rate : 0;
  Moment moment{.at = packet.at, .idle = start + Duration{static_cast<std::int64_t>(on_air_ns)}};
  moment.due = std::max(before.floor, moment.idle + schedule_.one_way(moment.idle));
  moment.floor = packet.lost ? before.floor : moment.due;
  return moment;
}

}  // namespace interneuron::netns::verify
