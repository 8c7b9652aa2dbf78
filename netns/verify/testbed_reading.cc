#include "netns/verify/session.h"

#include <algorithm>

#include "lab/emu/profile.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::netns::verify {

namespace {

std::vector<ScheduleSample> last_second(const State& state, std::size_t link) {
  const auto epoch = Testbed::snapshot(state).epoch;
  if (!epoch) return {};
  const Duration now = monotonic() - epoch->time_since_epoch();
  return Testbed::schedule(state, link, std::max(Duration{}, now - std::chrono::seconds(1)), now);
}

}  // namespace

Duration monotonic() { return io::now().time_since_epoch(); }

const emu::DirectionStats& counters(const Snapshot& snapshot, std::size_t link,
                                    Direction direction) {
  return direction == Direction::kUp ? snapshot.links[link].up : snapshot.links[link].down;
}

emu::DirectionStats difference(const emu::DirectionStats& before,
                               const emu::DirectionStats& after) {
  using Stats = emu::DirectionStats;
  Stats out;
  for (const auto field :
       {&Stats::packets_in, &Stats::lost, &Stats::queue_drops, &Stats::outage_lost, &Stats::too_big,
        &Stats::nat_drops, &Stats::policed, &Stats::duplicated, &Stats::reordered}) {
    out.*field = after.*field - before.*field;
  }
  return out;
}

Disturbance disturbance(const Snapshot& before, const Snapshot& after) {
  Disturbance out{.late_max_ms = after.lateness_max_us / 1e3,
                  .kernel_drops = after.kernel_drops - before.kernel_drops};
  if (after.frames_sent > before.frames_sent) {
    const auto sum_us = [](const Snapshot& s) {
      return s.lateness_mean_us * static_cast<double>(s.frames_sent);
    };
    out.late_mean_ms = (sum_us(after) - sum_us(before)) /
                       static_cast<double>(after.frames_sent - before.frames_sent) / 1e3;
  }
  return out;
}

double present_mbit(const State& state, std::size_t link, Direction direction) {
  return Schedule(last_second(state, link)).top_rate(direction).mbit();
}

double lasting_mbit(const State& state, std::size_t link, Direction direction) {
  double out = present_mbit(state, link, direction);
  const emu::DirectionParams carrier = Testbed::carrier(state, link, direction);
  for (const emu::TokenBucketParams& bucket : {carrier.police, carrier.shape}) {
    if (bucket.rate.bits_per_second > 0) out = std::min(out, bucket.rate.mbit());
  }
  return out;
}

Duration longest_delay(const State& state, const std::vector<std::size_t>& links) {
  Duration longest{};
  for (const std::size_t link : links) {
    for (const auto& sample : last_second(state, link)) longest = std::max(longest, sample.rtt / 2);
  }
  return longest;
}

Asked asked_of(const TestbedLink& link, Direction direction, const emu::DirectionStats& counted,
               std::size_t ip_bytes) {
  const auto profile = emu::built_in_profile(link.profile);
  if (!profile) return {counted.reordered > 0, counted.duplicated > 0, std::nullopt};
  const emu::DirectionParams& params = profile->direction(direction);
  const bool nat = profile->nat.reorder > 0 && profile->nat.reorder_above < ip_bytes;
  return {params.reorder > 0 || nat, params.duplicate > 0, params.gilbert_elliott};
}

std::string obstacle(const TestbedLink& link) {
  // The IP bytes of a TCP acknowledgement: 20 of IPv4, 20 of TCP, 12 of time stamps.
  constexpr std::size_t kTcpAcknowledgement = 52;
  const auto profile = emu::built_in_profile(link.profile);
  if (!profile || profile->nat.drop_below <= kTcpAcknowledgement) return "";
  return "the NAT drops TCP's acknowledgements";
}

}  // namespace interneuron::netns::verify
