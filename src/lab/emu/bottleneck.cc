#include "lab/emu/bottleneck.h"

#include <algorithm>
#include <charconv>

namespace interneuron::emu {

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kNsPerMs = 1'000'000;
// 116 days, so that times in nanoseconds cannot overflow.
constexpr std::int64_t kMaxTraceMs = 10'000'000'000;

std::string at_line(std::size_t line, const std::string& what) {
  return "line " + std::to_string(line) + ": " + what;
}

// The index of the step that holds at `in_period`, which is since the start of a period.
std::size_t step_at(const SteppedRate& rate, Duration in_period) {
  const auto after = std::partition_point(rate.steps.begin(), rate.steps.end(),
                                          [&](const RateStep& s) { return s.at <= in_period; });
  return static_cast<std::size_t>(after - rate.steps.begin()) - 1;
}

struct RateNow {
  DataRate rate{};
  Duration until = Duration::max();
};

RateNow rate_at(const SteppedRate& stepped, Duration t) {
  const bool repeats = stepped.period > Duration{};
  const Duration lap = repeats ? t / stepped.period * stepped.period : Duration{};
  const std::size_t i = step_at(stepped, t - lap);
  const bool last = i + 1 == stepped.steps.size();
  if (last && !repeats) return {stepped.steps[i].rate, Duration::max()};
  return {stepped.steps[i].rate, lap + (last ? stepped.period : stepped.steps[i + 1].at)};
}

Duration opportunity_time(const Opportunities& trace, std::uint64_t n) {
  const std::uint64_t count = trace.at_ms.size();
  const auto lap = static_cast<std::int64_t>(n / count);
  return Duration{(lap * trace.at_ms.back() + trace.at_ms[n % count]) * kNsPerMs};
}

// The first opportunity at or after `t`.
std::uint64_t first_opportunity(const Opportunities& trace, Duration t) {
  const std::int64_t lap_ns = trace.at_ms.back() * kNsPerMs;
  // One lap early, because the last instant of a lap is also the first of the next.
  const std::int64_t lap = std::max<std::int64_t>(0, t.count() / lap_ns - 1);
  const std::uint64_t count = trace.at_ms.size();
  std::uint64_t n = static_cast<std::uint64_t>(lap) * count;
  while (opportunity_time(trace, n + count - 1) < t) n += count;
  const std::int64_t base = static_cast<std::int64_t>(n / count) * trace.at_ms.back();
  const auto it =
      std::partition_point(trace.at_ms.begin(), trace.at_ms.end(),
                           [&](std::int64_t ms) { return (base + ms) * kNsPerMs < t.count(); });
  return n + static_cast<std::uint64_t>(it - trace.at_ms.begin());
}

DataRate bits_in(double bits, Duration span) {
  return {static_cast<std::int64_t>(bits * 1e9 / static_cast<double>(span.count()))};
}

double bits_between(const SteppedRate& stepped, Duration from, Duration to) {
  double bits = 0;
  while (from < to) {
    const RateNow now = rate_at(stepped, from);
    const Duration end = std::min(to, now.until);
    bits += static_cast<double>(now.rate.bits_per_second) *
            static_cast<double>((end - from).count()) / 1e9;
    from = end;
  }
  return bits;
}

}  // namespace

std::variant<Opportunities, std::string> parse_opportunities(std::string_view text) {
  Opportunities trace;
  for (std::size_t line_number = 1; !text.empty(); ++line_number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) {
      return at_line(line_number, "the file is cut off: its last line has no end");
    }
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
    if (line.empty() || line.front() == '#') continue;
    std::int64_t ms = 0;
    const auto [stop, error] = std::from_chars(line.data(), line.data() + line.size(), ms);
    const bool whole = error == std::errc{} && stop == line.data() + line.size();
    if (!whole || ms < 0 || ms > kMaxTraceMs) {
      return at_line(line_number,
                     "'" + std::string(line.substr(0, 20)) + "' must be a whole number of ms");
    }
    if (!trace.at_ms.empty() && ms < trace.at_ms.back()) {
      return at_line(line_number, std::to_string(ms) + " ms is before the line above");
    }
    trace.at_ms.push_back(ms);
  }
  if (trace.at_ms.empty() || trace.at_ms.back() == 0) {
    return std::string("holds no opportunities after 0 ms; write one per line, in ms");
  }
  return trace;
}

DataRate mean_rate(const SteppedRate& stepped) {
  const Duration span = stepped.period > Duration{} ? stepped.period : stepped.steps.back().at;
  // Without a period the last rate stays for ever; one that is 0 leaves the mean of what was
  // before.
  const DataRate last = stepped.steps.back().rate;
  if (stepped.period <= Duration{} && (last.bits_per_second > 0 || span <= Duration{})) return last;
  return bits_in(bits_between(stepped, Duration{}, span), span);
}

DataRate mean_rate(const Opportunities& trace) {
  const double bits = static_cast<double>(trace.at_ms.size()) * kOpportunityBytes * 8;
  return bits_in(bits, Duration{trace.at_ms.back() * kNsPerMs});
}

Bottleneck::Bottleneck(DataRate rate) : rate_(rate) {}

Bottleneck::Bottleneck(const RateTrace& trace, Duration origin)
    : trace_(trace), traced_(true), origin_(origin) {}

Duration Bottleneck::departure(Duration at, std::size_t ip_bytes) {
  const Duration now = at - origin_;
  asked_ = sent_;
  if (asked_.busy_until < now) {
    asked_.busy_until = now;
    asked_.remainder = 0;
  }
  if (!traced_) {
    if (rate_.bits_per_second <= 0) return Duration::max();
    send_constant(asked_, rate_.bits_per_second, ip_bytes);
  } else if (const auto* stepped = std::get_if<std::shared_ptr<const SteppedRate>>(&trace_)) {
    if (!send_stepped(asked_, **stepped, ip_bytes)) return Duration::max();
  } else {
    send_opportunities(asked_, *std::get<std::shared_ptr<const Opportunities>>(trace_), ip_bytes);
  }
  return asked_.busy_until + origin_;
}

void Bottleneck::busy_until(Duration t) { sent_ = {t - origin_, 0, 0, 0}; }

// Moves busy_until on by the time that the packet takes, to the exact fraction of a nanosecond.
void Bottleneck::send_constant(State& state, std::int64_t rate, std::size_t ip_bytes) const {
  // An IP packet has at most 65535 bytes = 5.3e14 bit ns, far from overflow.
  const std::int64_t bit_ns =
      static_cast<std::int64_t>(ip_bytes) * 8 * kNsPerSecond + state.remainder;
  state.busy_until += Duration{bit_ns / rate};
  state.remainder = bit_ns % rate;
}

bool Bottleneck::send_stepped(State& state, const SteppedRate& stepped,
                              std::size_t ip_bytes) const {
  // In bit ns, so that a step within a packet costs nothing of its exactness.
  std::int64_t bit_ns = static_cast<std::int64_t>(ip_bytes) * 8 * kNsPerSecond + state.remainder;
  state.remainder = 0;
  for (;;) {
    const RateNow now = rate_at(stepped, state.busy_until);
    const std::int64_t rate = now.rate.bits_per_second;
    const Duration left = now.until - state.busy_until;
    const bool within = rate > 0 && (bit_ns / rate < left.count() ||
                                     (bit_ns / rate == left.count() && bit_ns % rate == 0));
    if (within) {
      state.busy_until += Duration{bit_ns / rate};
      state.remainder = bit_ns % rate;
      return true;
    }
    if (now.until == Duration::max()) return false;
    bit_ns -= rate * left.count();
    state.busy_until = now.until;
  }
}

void Bottleneck::send_opportunities(State& state, const Opportunities& trace,
                                    std::size_t ip_bytes) const {
  if (state.left == 0 || opportunity_time(trace, state.opportunity) < state.busy_until) {
    // What is left of an opportunity is for packets that wait when it comes.
    const std::uint64_t first = first_opportunity(trace, state.busy_until);
    state.opportunity = std::max(first, state.opportunity);
    state.left = kOpportunityBytes;
  }
  while (ip_bytes > state.left) {
    ip_bytes -= state.left;
    ++state.opportunity;
    state.left = kOpportunityBytes;
  }
  state.left -= ip_bytes;
  state.busy_until = std::max(state.busy_until, opportunity_time(trace, state.opportunity));
  if (state.left > 0) return;
  // The opportunity is used up; the next packet begins with `left` == 0.
  ++state.opportunity;
}

DataRate Bottleneck::mean(Duration at, Duration span) const {
  if (!traced_) return rate_;
  const Duration now = std::max(Duration{}, at - origin_);
  if (const auto* stepped = std::get_if<std::shared_ptr<const SteppedRate>>(&trace_)) {
    return bits_in(bits_between(**stepped, now, now + span), span);
  }
  const auto& trace = *std::get<std::shared_ptr<const Opportunities>>(trace_);
  const std::uint64_t count = first_opportunity(trace, now + span) - first_opportunity(trace, now);
  return bits_in(static_cast<double>(count) * kOpportunityBytes * 8, span);
}

TokenBucket::TokenBucket(const TokenBucketParams& params)
    : rate_(params.rate), depth_(params.rate.transmit_time(params.bytes)) {}

TokenBucket::TokenBucket(const TokenBucketParams& params, Duration t) : TokenBucket(params) {
  if (rate_.bits_per_second > 0) full_at_ = t + depth_;
}

Duration TokenBucket::conforms(Duration at, std::size_t ip_bytes) const {
  if (rate_.bits_per_second <= 0) return at;
  const Duration cost = rate_.transmit_time(ip_bytes);
  return cost > depth_ ? Duration::max() : std::max(at, full_at_ + cost - depth_);
}

void TokenBucket::take(Duration at, std::size_t ip_bytes) {
  if (rate_.bits_per_second > 0) full_at_ = std::max(full_at_, at) + rate_.transmit_time(ip_bytes);
}

}  // namespace interneuron::emu
