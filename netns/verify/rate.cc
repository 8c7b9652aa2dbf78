// judge_rate() of assess.h: whether a saturated link is as fast as its schedule says, from what
// tcpdump saw at the receiver.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "netns/verify/assess.h"

namespace interneuron::netns::verify {

namespace {

// Nothing is counted before this: with 15 % too much offered, the bottleneck's queue has grown to
// 100 ms by then.
constexpr Duration kWarmUp = std::chrono::milliseconds(700);
// A sender that pauses for longer may let a queue of 100 ms run dry, as a queue behind a variable
// rate is not always full.
constexpr Duration kLongestPause = std::chrono::milliseconds(60);
// The window's first packet is looked for within this much after kWarmUp, its last packet within
// this much before the end, among kCandidates packets at most (which bounds the work, not the
// result).
constexpr Duration kEndRegion = std::chrono::milliseconds(500);
constexpr std::size_t kCandidates = 200;
// A shorter window is not judged: 30 ms of lateness at its ends would be 3 % already.
constexpr double kShortestSeconds = 1;

using Index = std::size_t;

// What was received, prescribed and offered between the two packets that bound the window.
struct Reading {
  double seconds = 0;
  double received_bits = 0;
  double prescribed_bits = 0;
  double offered_mbit = 0;
  // The longest time between the stamps of two consecutive packets: a pause of the sender.
  Duration longest_pause{};
};

// How far the receiver is behind the schedule at each packet of a run: the bits that an always busy
// bottleneck would have delivered since the first packet, less those received. Refers to `run`,
// which must outlive it and must not be empty.
class Lag {
 public:
  Lag(const RateRun& run, Direction direction) : run_(run), direction_(direction) {
    received_.reserve(run.received.size());
    double bits = 0;
    for (const Datagram& d : run.received)
      received_.push_back(bits += 8.0 * static_cast<double>(d.ip_bytes));
    origin_ = run.schedule.sent_by(run.received.front().seen);
  }
  // The bits that a bottleneck which is never idle would have delivered until packet i arrived, and
  // those that had arrived.
  double prescribed(Index i) const {
    return run_.schedule.bits_between(direction_, origin_,
                                      run_.schedule.sent_by(run_.received[i].seen));
  }
  double received(Index i) const { return received_[i]; }

  // The packet with the least lag among those in [begin, end). A machine that is late delivers
  // later, but not less, so this packet tells best how far the bottleneck was.
  Index least_lag(Index begin, Index end) const {
    const Index stride = std::max<Index>(1, (end - begin) / kCandidates);
    Index best = begin;
    double smallest = std::numeric_limits<double>::max();
    for (Index i = begin; i < end; i += stride) {
      const double lag = prescribed(i) - received(i);
      if (lag >= smallest) continue;
      smallest = lag;
      best = i;
    }
    return best;
  }

 private:
  const RateRun& run_;
  Direction direction_;
  // IP bits up to and including each packet.
  std::vector<double> received_;
  Duration origin_{};
};

Index first_from(const std::vector<Datagram>& records, Duration t) {
  return static_cast<Index>(
      std::find_if(records.begin(), records.end(), [t](const Datagram& d) { return d.seen >= t; }) -
      records.begin());
}

std::optional<Reading> read(const RateRun& run, Direction direction) {
  const auto& all = run.received;
  if (all.size() < 2 || !run.schedule.covers(all.front().seen, all.back().seen)) {
    return std::nullopt;
  }
  const Duration begin = all.front().seen + kWarmUp;
  const Duration end = all.back().seen - kEndRegion;
  if (end - begin < kEndRegion) return std::nullopt;
  const Lag lag(run, direction);
  const Index first = lag.least_lag(first_from(all, begin), first_from(all, begin + kEndRegion));
  const Index last = lag.least_lag(first_from(all, end), all.size());
  Reading out{.seconds = to_seconds(all[last].seen - all[first].seen),
              .received_bits = lag.received(last) - lag.received(first),
              .prescribed_bits = lag.prescribed(last) - lag.prescribed(first)};
  const double stamps = to_seconds(all[last].stamp - all[first].stamp);
  const double numbers = static_cast<double>(all[last].number) - all[first].number;
  if (stamps > 0) {
    out.offered_mbit = numbers * 8e-6 * static_cast<double>(all[last].ip_bytes) / stamps;
  }
  for (Index i = first; i < last; ++i) {
    out.longest_pause = std::max(out.longest_pause, all[i + 1].stamp - all[i].stamp);
  }
  return out;
}

Figure unread(const std::string& name, const RateRun& run, Direction direction) {
  const Schedule& s = run.schedule;
  if (!s.empty() && s.mostly_out(direction, s.begin(), s.end())) {
    return without_verdict(name, "an outage", Verdict::kNotMeasured);
  }
  return without_verdict(name, run.failure.empty() ? "too little came" : run.failure,
                         Verdict::kInconclusive);
}

// Makes the figure inconclusive where the machine or the tools explain the difference.
void excuse(Figure& figure, const RateRun& run, const Reading& reading, Direction direction) {
  // The rate of a link shows only where more than that is offered.
  const double needed_mbit = run.schedule.top_rate(direction).mbit() * (1 + kRatePercent / 100);
  if (reading.offered_mbit < needed_mbit) {
    inconclusive(figure, fmt::format("iperf3 sent {:.1f} Mbit/s only", reading.offered_mbit));
  }
  if (figure.verdict == Verdict::kFailed && *figure.difference < 0) {
    if (reading.longest_pause > kLongestPause) {
      inconclusive(figure,
                   fmt::format("iperf3 paused for {:.0f} ms", to_ms(reading.longest_pause)));
    } else if (run.kernel_drops > 0) {
      inconclusive(figure, fmt::format("the kernel dropped {} frames", run.kernel_drops));
    }
  }
  if (run.capture_drops > 0) {
    inconclusive(figure, fmt::format("tcpdump missed {} packets", run.capture_drops));
  }
}

}  // namespace

Figure judge_rate(const std::string& name, const RateRun& run, Direction direction) {
  if (!run.not_measured.empty()) {
    return without_verdict(name, run.not_measured, Verdict::kNotMeasured);
  }
  for (const emu::TokenBucketParams& bucket : {run.carrier.police, run.carrier.shape}) {
    const DataRate rate = run.schedule.empty() ? DataRate{} : run.schedule.top_rate(direction);
    if (bucket.rate.bits_per_second > 0 && bucket.rate < rate) {
      return without_verdict(name, "a token bucket limits it", Verdict::kNotMeasured);
    }
  }
  const auto reading = read(run, direction);
  if (!reading || reading->seconds < kShortestSeconds) return unread(name, run, direction);
  Figure figure;
  figure.name = name;
  figure.unit = "Mbit/s";
  figure.difference_unit = "%";
  figure.target = reading->prescribed_bits / reading->seconds / 1e6;
  figure.measured = reading->received_bits / reading->seconds / 1e6;
  if (*figure.target <= 0) {
    figure.note = "an outage";
    return figure;
  }
  figure.difference = 100 * (*figure.measured / *figure.target - 1);
  figure.verdict = std::abs(*figure.difference) <= kRatePercent ? Verdict::kOk : Verdict::kFailed;
  excuse(figure, run, *reading, direction);
  return figure;
}

}  // namespace interneuron::netns::verify
