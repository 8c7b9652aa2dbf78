#include "netns/verify/carrier.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/statistics.h"

namespace interneuron::netns::verify {

namespace {

// No window of a saturated flow is shorter, and what a bucket let pass at first is left out of it.
constexpr double kShortestFlowSeconds = 1;
constexpr double kWarmUpSeconds = 0.7;
// With fewer grants, or fewer packets, their median says little. No measurement behind the values.
constexpr std::size_t kLeastGrants = 20;
constexpr std::size_t kLeastHeld = 50;
// A burst may differ by so many bytes besides: what leaves a token bucket are whole packets.
constexpr double kWholePackets = 2 * 1500;
// Packets that were held up by one before them leave the emulator with it.
constexpr Duration kTogether = std::chrono::microseconds(300);
// What a ping may differ from another one by itself on a busy machine, without a verdict on it.
constexpr double kPingMs = 2;

Figure compared(std::string name, std::string unit, double target, double measured,
                double tolerance) {
  Figure figure;
  figure.name = std::move(name);
  figure.unit = std::move(unit);
  figure.target = target;
  figure.measured = measured;
  const bool points = figure.unit == "%";
  figure.difference = points ? measured - target : 100 * (measured / target - 1);
  figure.difference_unit = points ? "points" : "%";
  figure.verdict = std::abs(measured - target) <= tolerance ? Verdict::kOk : Verdict::kFailed;
  return figure;
}

double seconds_between(const Datagram& a, const Datagram& b) { return to_seconds(b.seen - a.seen); }

// The figures of one bucket from the flow that saturates the link, which begins with it full.
class BucketRun {
 public:
  BucketRun(const RateRun& run, const emu::TokenBucketParams& bucket, Direction direction)
      : run_(run), rate_(static_cast<double>(bucket.rate.bits_per_second) / 8), bucket_(bucket) {
    if (run.received.size() < 2) return;
    survives_ = 1 - run.schedule.loss(direction, run.received.front().seen);
    read();
  }

  // Why there is no verdict; empty: there is one.
  const std::string& obstacle() const { return obstacle_; }

  Figure rate(const std::string& name) const {
    const double target = bucket_.rate.mbit() * survives_;
    return compared(name, "Mbit/s", target, passed_ * 8e-6, target * kBucketRatePercent / 100);
  }
  Figure dropped(const std::string& name) const {
    return compared(name, "%", 100 * (1 - survives_ * rate_ / offered_), 100 * (1 - arrived_share_),
                    kPolicedPoints);
  }
  // What came at most beyond the bucket's rate since the first packet.
  Figure burst(const std::string& name) const {
    const double target = static_cast<double>(bucket_.bytes) * survives_;
    double most = 0;
    double bytes = 0;
    for (const Datagram& d : run_.received) {
      bytes += static_cast<double>(d.ip_bytes);
      most = std::max(most, bytes - survives_ * rate_ * seconds_between(run_.received.front(), d));
    }
    return compared(name, "kB", target / 1e3, most / 1e3,
                    std::max(target * kBucketBurstPercent / 100, kWholePackets) / 1e3);
  }

 private:
  void read() {
    const std::vector<Datagram>& all = run_.received;
    const double numbers = static_cast<double>(all.back().number) - all.front().number;
    const double stamps = to_seconds(all.back().stamp - all.front().stamp);
    if (numbers <= 0 || stamps <= 0) return;
    offered_ = numbers * static_cast<double>(all.front().ip_bytes) / stamps;
    obstacle_ = "the link is no faster than the bucket";
    // A rate that is hardly above that of the bucket empties it in no time that is measured.
    if (offered_ < rate_ * (1 + 2 * kBucketRatePercent / 100)) return;
    const double drained = static_cast<double>(bucket_.bytes) / (offered_ - rate_);
    const Duration begin = all.front().seen + from_ms(1e3 * (drained * 1.1 + kWarmUpSeconds));
    const auto first = std::ranges::lower_bound(all, begin, {}, &Datagram::seen);
    obstacle_ = "the bucket lasts for longer than the flow";
    if (first == all.end() || seconds_between(*first, all.back()) < kShortestFlowSeconds) return;
    obstacle_.clear();
    double bytes = 0;
    for (auto it = std::next(first); it != all.end(); ++it) {
      bytes += static_cast<double>(it->ip_bytes);
    }
    passed_ = bytes / seconds_between(*first, all.back());
    arrived_share_ = static_cast<double>(all.end() - first - 1) /
                     (static_cast<double>(all.back().number) - first->number);
  }

  const RateRun& run_;
  // Bytes a second.
  double rate_;
  emu::TokenBucketParams bucket_;
  std::string obstacle_ = "too little came";
  // The share of what has passed the bucket that the radio does not lose.
  double survives_ = 1;
  double offered_ = 0;
  double passed_ = 0;
  double arrived_share_ = 0;
};

void add_bucket(const std::string& name, const RateRun& run, const emu::TokenBucketParams& bucket,
                Direction direction, bool drops, std::vector<Figure>& out) {
  if (bucket.rate.bits_per_second <= 0) return;
  const BucketRun reading(run, bucket, direction);
  const std::string why = run.not_measured.empty() ? reading.obstacle() : run.not_measured;
  if (!why.empty()) {
    out.push_back(without_verdict(name + " rate", why, Verdict::kNotMeasured));
    return;
  }
  const std::size_t first = out.size();
  out.push_back(reading.rate(name + " rate"));
  if (drops) out.push_back(reading.dropped(name + " drops"));
  out.push_back(reading.burst(name + " burst"));
  for (std::size_t i = first; i < out.size(); ++i) {
    if (run.capture_drops > 0) {
      inconclusive(out[i], fmt::format("tcpdump missed {} packets", run.capture_drops));
    } else if (run.kernel_drops > 0) {
      inconclusive(out[i], fmt::format("the kernel dropped {} frames", run.kernel_drops));
    }
  }
}

// What saturates a link with grants comes in groups, each of a grant.
void add_grants(const std::string& name, const RateRun& run, std::vector<Figure>& out) {
  const Duration every = run.carrier.grant_every;
  if (every <= Duration{}) return;
  const double share = run.carrier.grant_share;
  const double pause_ms = to_ms(every) * (1 - share);
  std::vector<double> periods;
  std::vector<double> shares;
  // Where the present grant began, and how many packets it had.
  std::size_t first = 0;
  for (std::size_t i = 1; i < run.received.size(); ++i) {
    if (to_ms(run.received[i].seen - run.received[i - 1].seen) < pause_ms / 2) continue;
    const auto packets = static_cast<double>(i - first);
    const double period = to_ms(run.received[i].seen - run.received[first].seen);
    const double length = to_ms(run.received[i - 1].seen - run.received[first].seen);
    if (first > 0) periods.push_back(period);
    if (first > 0 && packets > 1) {
      shares.push_back(100 * length * packets / (packets - 1) / period);
    }
    first = i;
  }
  if (!run.not_measured.empty() || periods.size() < kLeastGrants) {
    out.push_back(without_verdict(name + " grant period",
                                  run.not_measured.empty()
                                      ? fmt::format("{} grants were seen", periods.size())
                                      : run.not_measured,
                                  Verdict::kNotMeasured));
    return;
  }
  out.push_back(compared(name + " grant period", "ms", to_ms(every), percentile(periods, 0.5),
                         to_ms(every) * kGrantPercent / 100));
  if (shares.size() < kLeastGrants) return;
  out.push_back(compared(name + " grant share", "%", 100 * share, percentile(shares, 0.5),
                         kGrantSharePoints));
}

// The probability that hybrid ARQ, which holds up all behind a packet, makes packet `i` later than
// `by`: that not all before it let it pass.
double late_chance(const DirectionEvidence& e, const Course& course, std::size_t i, Duration by) {
  const emu::DirectionParams& carrier = e.asked.carrier;
  const Duration longest = carrier.harq_by * emu::DirectionParams::kHarqTries;
  double passes = 1;
  for (std::size_t j = i + 1; j-- > 0;) {
    const Duration needs = by + (course.arrival(i) - course.arrival(j));
    if (needs >= longest) break;
    const auto tries = needs / carrier.harq_by + 1;
    passes *= 1 - std::pow(carrier.harq, static_cast<double>(tries));
  }
  return 1 - passes;
}

void add_harq(const std::string& name, const DirectionEvidence& e, const Course& course,
              std::vector<Figure>& out) {
  const emu::DirectionParams& carrier = e.asked.carrier;
  if (carrier.harq <= 0) return;
  const Duration half = carrier.harq_by / 2;
  std::vector<double> steps;
  double arrived = 0;
  double late = 0;
  double expected = 0;
  Duration before{};
  for (std::size_t i = 0; i < e.flow.packets.size(); ++i) {
    const Flow::Packet& p = e.flow.packets[i];
    if (!p.arrived) continue;
    const Duration excess = *p.arrived - course.arrival(i);
    arrived += 1;
    late += excess > half ? 1 : 0;
    expected += late_chance(e, course, i, half);
    // One that was sent again once, and did not wait behind another one.
    const bool alone = *p.arrived - before > kTogether;
    if (alone && excess > half && excess < half * 3) steps.push_back(to_ms(excess));
    before = *p.arrived;
  }
  if (steps.size() < kLeastHeld) {
    out.push_back(without_verdict(name + " HARQ step",
                                  fmt::format("{} packets were sent again", steps.size()),
                                  Verdict::kNotMeasured));
    return;
  }
  const double step = to_ms(carrier.harq_by);
  out.push_back(compared(name + " HARQ step", "ms", step, percentile(steps, 0.5),
                         std::max(step * kHarqStepPercent / 100, to_ms(kTogether))));
  const double target = 100 * expected / arrived;
  // As many packets as were sent again decide, for those behind share their fate.
  const double share = expected / arrived;
  const double chance = 100 * std::sqrt(share * (1 - share) / (arrived * carrier.harq));
  constexpr double kDeviations = 3;
  out.push_back(compared(name + " HARQ late", "%", target, 100 * late / arrived,
                         std::max(target * kHarqLatePercent / 100, kDeviations * chance)));
}

void add_wake(const std::string& name, const DirectionEvidence& e, std::vector<Figure>& out) {
  const Duration by = e.asked.carrier.wake_by;
  if (by <= Duration{}) return;
  if (!e.woke_after) {
    out.push_back(without_verdict(name + " wake-up", e.not_woken, Verdict::kNotMeasured));
    return;
  }
  out.push_back(compared(name + " wake-up", "ms", to_ms(by), to_ms(*e.woke_after),
                         std::max(to_ms(by) * kWakePercent / 100, kPingMs)));
}

}  // namespace

bool delays(const emu::DirectionParams& carrier) {
  return carrier.grant_every > Duration{} || carrier.harq > 0;
}

std::vector<Figure> judge_carrier(const std::string& name, const DirectionEvidence& e,
                                  Direction direction, const Course& course) {
  std::vector<Figure> out;
  add_bucket(name + " policer", e.rate, e.rate.carrier.police, direction, true, out);
  add_bucket(name + " shaper", e.rate, e.rate.carrier.shape, direction, false, out);
  add_grants(name, e.rate, out);
  add_harq(name, e, course, out);
  add_wake(name, e, out);
  return out;
}

}  // namespace interneuron::netns::verify
