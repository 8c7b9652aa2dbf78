#include "lab/load/figures.h"

#include <algorithm>

#include "lab/foreign/segment.h"

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

// A late vehicle has its share when it had this part of it over such a window, which is looked at
// in such steps. No measurement behind the window: it only has to hold some ten messages.
constexpr double kEnoughShare = 0.8;
constexpr Duration kShareWindow = 500ms;
constexpr Duration kShareStep = 10ms;

double bytes_in(DataRate rate, Duration time) {
  return static_cast<double>(rate.bits_per_second) / 8 * to_seconds(time);
}

double mbit_of(double bytes, Duration time) { return bytes * 8e-6 / to_seconds(time); }

std::optional<double> whole_after_ms(const Scenario& s, const Meter& meter, Duration begin) {
  if (!s.dip) return std::nullopt;
  const Duration back = begin + s.dip->at + s.dip->length;
  for (const Meter::Message& m : meter.messages(0)) {
    if (m.begun >= back && meter.on_time(m) && m.variant == 0) return to_ms(m.begun - back);
  }
  return std::nullopt;
}

std::optional<double> share_after_ms(const Scenario& s, const Meter& meter, Duration end) {
  const std::size_t last = s.vehicles - 1;
  if (!s.late || meter.messages(last).empty()) return std::nullopt;
  const Duration first = meter.messages(last).front().begun;
  const double share = bytes_in(s.capacity, kShareWindow) * payload_share(s.message_bytes) /
                       static_cast<double>(s.vehicles);
  for (Duration at = first; at <= end; at += kShareStep) {
    const auto had = static_cast<double>(meter.on_time_bytes(last, at - kShareWindow, at));
    if (had >= kEnoughShare * share) return to_ms(at - first);
  }
  return std::nullopt;
}

// Of the messages that begin within kEarly of the first one of their vehicle, or of the others;
// nothing where there are none.
std::optional<double> missed_percent(const Meter& meter, bool is_early) {
  double all = 0;
  double missed = 0;
  for (std::size_t v = 0; v < meter.vehicles(); ++v) {
    for (const Meter::Message& m : meter.messages(v)) {
      if ((m.begun - meter.messages(v).front().begun < kEarly) != is_early) continue;
      ++all;
      missed += meter.on_time(m) ? 0 : 1;
    }
  }
  return all > 0 ? std::optional(100 * missed / all) : std::nullopt;
}

// For so long the bottleneck has nothing to do while vehicles join: the shares of the load of those
// that have joined leave this part of it free.
Duration idle_while_joining(const Scenario& s) {
  const std::vector<Duration> joined = joins(s);
  double idle = 0;
  for (std::size_t v = 1; v < joined.size(); ++v) {
    const double offered = s.load * static_cast<double>(v) / static_cast<double>(s.vehicles);
    idle += std::max(0.0, 1 - offered) * static_cast<double>((joined[v] - joined[v - 1]).count());
  }
  return Duration{static_cast<std::int64_t>(idle)};
}

// How long each vehicle sends.
std::vector<Duration> spans_of_vehicles(const Scenario& s) {
  std::vector<Duration> out = joins(s);
  for (Duration& joined : out) joined = span_of(s) - joined;
  return out;
}

}  // namespace

double capacity_bytes(const Scenario& s) {
  const Duration span = span_of(s);
  if (!s.dip) return bytes_in(s.capacity, span);
  return bytes_in(s.capacity, span - s.dip->length) + bytes_in(s.dip->rate, s.dip->length);
}

double payload_capacity(const Scenario& s) {
  return (capacity_bytes(s) - bytes_in(s.capacity, idle_while_joining(s))) *
         payload_share(s.message_bytes);
}

void read_messages(const Scenario& s, const Meter& meter, Duration begin, Row& row) {
  row.messages = meter.count();
  row.missed = meter.missed();
  row.degraded = meter.degraded();
  row.age_p50_ms = to_ms(meter.age(0.50));
  row.age_p99_ms = to_ms(meter.age(0.99));
  const auto on_time = static_cast<double>(meter.on_time_bytes());
  row.on_time_goodput_mbit = mbit_of(on_time, span_of(s));
  const auto offered = static_cast<double>(row.messages * s.message_bytes);
  row.of_possible = on_time / std::min(offered, payload_capacity(s));
  if (s.vehicles > 1) {
    row.jain = meter.jain(spans_of_vehicles(s));
    row.early_missed_percent = missed_percent(meter, true);
    row.later_missed_percent = missed_percent(meter, false);
  }
  row.whole_after_ms = whole_after_ms(s, meter, begin);
  row.share_after_ms = share_after_ms(s, meter, begin + span_of(s));
}

void read_bottleneck(const std::optional<BottleneckPart>& joining, const BottleneckPart& rest,
                     Row& row) {
  row.queue_p99_ms = rest.queue_p99_ms;
  row.utilisation = rest.utilisation;
  if (!joining) return;
  row.joining_queue_p99_ms = joining->queue_p99_ms;
  const double part = to_seconds(joining->length) / to_seconds(joining->length + rest.length);
  row.utilisation = part * joining->utilisation + (1 - part) * rest.utilisation;
}

void read_cross_traffic(const Scenario& s, const Meter& meter, double bytes, Row& row) {
  if (s.cross_flows == 0) return;
  const auto parties = static_cast<double>(s.vehicles + s.cross_flows);
  const double own = payload_capacity(s) * static_cast<double>(s.vehicles) / parties;
  const double cross = capacity_bytes(s) * foreign::kMss / (foreign::kMss + foreign::kTcpIpBytes) *
                       static_cast<double>(s.cross_flows) / parties;
  row.own_share = static_cast<double>(meter.on_time_bytes()) / own;
  row.cross_share = bytes / cross;
}

}  // namespace interneuron::load
