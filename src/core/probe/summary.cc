#include "core/probe/summary.h"

#include <algorithm>
#include <cmath>

namespace interneuron::probe {
namespace {

// One-way delays are compared with the least of the bucket they are in and of its neighbours: two
// clocks that drift apart by 50 ppm are 0.5 ms off in 10 s.
constexpr Duration kBucket = std::chrono::seconds(5);

bool is_ping(const SentPacket& p) { return p.purpose == Purpose::kPing; }

Duration nearest_rank(const std::vector<Duration>& sorted, double q) {
  const double rank = std::ceil(q * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

template <class Member>
std::vector<Duration> variation(const PacketLog& log, Member member) {
  std::vector<Duration> out;
  if (log.empty()) return out;
  const TimePoint start = log.front().sent;
  const auto bucket_of = [start](const SentPacket& p) {
    return static_cast<std::size_t>(std::max((p.sent - start) / kBucket, std::int64_t{0}));
  };
  const auto counts = [](const SentPacket& p) { return is_ping(p) && p.answered; };
  std::vector<Duration> least;
  for (const SentPacket& p : log) {
    if (!counts(p)) continue;
    const std::size_t bucket = bucket_of(p);
    if (least.size() <= bucket) least.resize(bucket + 1, Duration::max());
    least[bucket] = std::min(least[bucket], p.*member);
  }
  for (const SentPacket& p : log) {
    if (!counts(p)) continue;
    const std::size_t bucket = bucket_of(p);
    Duration base = least[bucket];
    if (bucket > 0) base = std::min(base, least[bucket - 1]);
    if (bucket + 1 < least.size()) base = std::min(base, least[bucket + 1]);
    out.push_back(p.*member - base);
  }
  return out;
}

// Which of the reflector's numbers up to the largest were never seen.
std::vector<std::uint32_t> unseen_numbers(const PacketLog& log,
                                          const std::vector<std::uint32_t>& counted_twice) {
  // A reflector cannot have counted more than what was sent, and duplicates of it.
  const std::size_t bound = 4 * log.size() + 64;
  std::vector<bool> seen;
  const auto see = [&](std::uint32_t number) {
    if (number >= bound) return;
    if (seen.size() <= number) seen.resize(number + 1U);
    seen[number] = true;
  };
  for (const SentPacket& p : log) {
    if (p.answered) see(p.counted);
  }
  for (const std::uint32_t number : counted_twice) see(number);
  std::vector<std::uint32_t> unseen;
  for (std::uint32_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) unseen.push_back(i);
  }
  return unseen;
}

// For each number not seen, marks the packet that the reflector most probably gave it to: the first
// unanswered one behind the packet with the number before. Which one of several is marked does not
// matter, because how many were lost there and back between two answers stays exact.
std::vector<bool> lost_on_the_way_back(const PacketLog& log,
                                       const std::vector<std::uint32_t>& unseen) {
  std::vector<bool> back(log.size());
  // The reflector's number and the index into the log.
  std::vector<std::pair<std::uint32_t, std::size_t>> answered;
  for (std::size_t s = 0; s < log.size(); ++s) {
    if (log[s].answered) answered.emplace_back(log[s].counted, s);
  }
  std::ranges::sort(answered);
  std::size_t next = 0;
  std::size_t at = 0;
  for (const std::uint32_t number : unseen) {
    while (next < answered.size() && answered[next].first < number) {
      at = std::max(at, answered[next++].second + 1);
    }
    while (at < log.size() &&
           (log[at].answered || back[at] || log[at].purpose == Purpose::kSkipped)) {
      ++at;
    }
    if (at < log.size()) back[at] = true;
  }
  return back;
}

void count_bursts(const PacketLog& log, const std::vector<Fate>& fates, Summary& out) {
  std::size_t run = 0;
  for (std::size_t s = 0; s < log.size(); ++s) {
    if (!is_ping(log[s])) continue;
    const bool lost = fates[s] != Fate::kAnswered && fates[s] != Fate::kLate;
    run = lost ? run + 1 : 0;
    if (run == 1) ++out.bursts;
    out.longest_burst = std::max(out.longest_burst, run);
  }
}

}  // namespace

Distribution distribution_of(std::vector<Duration> samples) {
  Distribution d;
  d.samples = samples.size();
  if (samples.empty()) return d;
  std::ranges::sort(samples);
  d.min = samples.front();
  d.max = samples.back();
  d.p50 = nearest_rank(samples, 0.5);
  d.p95 = nearest_rank(samples, 0.95);
  const auto n = static_cast<double>(samples.size());
  for (const Duration x : samples) d.mean_ns += static_cast<double>(x.count()) / n;
  double squares = 0;
  for (const Duration x : samples) {
    const double away = static_cast<double>(x.count()) - d.mean_ns;
    squares += away * away / n;
  }
  d.stddev_ns = std::sqrt(squares);
  return d;
}

std::vector<Fate> fates_of(const PacketLog& log, Duration timeout, bool stateful,
                           const std::vector<std::uint32_t>& counted_twice) {
  std::vector<Fate> fates(log.size(), Fate::kLost);
  // The reflector's count covers every sequence number below this one.
  std::size_t known_until = 0;
  for (std::size_t s = 0; s < log.size(); ++s) {
    if (!log[s].answered) continue;
    known_until = s;
    fates[s] = log[s].received - log[s].sent > timeout ? Fate::kLate : Fate::kAnswered;
  }
  if (!stateful) return fates;
  const auto back = lost_on_the_way_back(log, unseen_numbers(log, counted_twice));
  for (std::size_t s = 0; s < known_until; ++s) {
    if (!log[s].answered) fates[s] = back[s] ? Fate::kLostDown : Fate::kLostUp;
  }
  return fates;
}

void summarise(const PacketLog& log, Duration timeout,
               const std::vector<std::uint32_t>& counted_twice, Summary& out) {
  const std::vector<Fate> fates = fates_of(log, timeout, out.stateful, counted_twice);
  std::vector<Duration> rtts;
  for (std::size_t s = 0; s < log.size(); ++s) {
    if (!is_ping(log[s])) continue;
    ++out.sent;
    if (log[s].answered) rtts.push_back(log[s].rtt());
    switch (fates[s]) {
      case Fate::kAnswered:
        ++out.answered;
        break;
      case Fate::kLate:
        ++out.late;
        break;
      case Fate::kLostUp:
        ++out.lost_up;
        break;
      case Fate::kLostDown:
        ++out.lost_down;
        break;
      case Fate::kLost:
        ++out.lost;
        break;
    }
  }
  count_bursts(log, fates, out);
  out.rtt = distribution_of(std::move(rtts));
  out.variation_up = distribution_of(variation(log, &SentPacket::up));
  out.variation_down = distribution_of(variation(log, &SentPacket::down));
}

}  // namespace interneuron::probe
