#include "netns/verify/assess.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/statistics.h"
#include "netns/verify/carrier.h"

namespace interneuron::netns::verify {

namespace {

constexpr std::array kDirectionsByName{std::pair{Direction::kUp, "up"},
                                       std::pair{Direction::kDown, "down"}};

// Delays of the packets that arrived: as scheduled and as measured, in the same order.
struct Delays {
  std::vector<double> expected_ms;
  std::vector<double> measured_ms;
};

std::vector<Sent> traffic_of(const Flow& flow) {
  std::vector<Sent> traffic;
  traffic.reserve(flow.packets.size());
  for (const Flow::Packet& p : flow.packets) {
    traffic.push_back({p.sent, p.ip_bytes, !p.arrived.has_value()});
  }
  return traffic;
}

Delays one_way(const Flow& flow, const Course& course) {
  Delays out;
  // The latest arrival among the packets sent so far.
  Duration latest{};
  for (std::size_t i = 0; i < flow.packets.size(); ++i) {
    const Flow::Packet& p = flow.packets[i];
    if (!p.arrived) continue;
    // A packet that overtook others was reordered on purpose and did not take the scheduled delay.
    // The figure "reordered" judges it, not this one.
    const bool overtook = *p.arrived < latest;
    latest = std::max(latest, *p.arrived);
    if (overtook) continue;
    out.expected_ms.push_back(to_ms(course.arrival(i) - p.sent));
    out.measured_ms.push_back(to_ms(*p.arrived - p.sent));
  }
  return out;
}

// The delays of the pings within the window. An answer is expected to leave when its request should
// have arrived.
Delays round_trip(const LinkEvidence& e, const Course& up, const Course& down) {
  Delays out;
  for (const Ping& ping : e.pings.answered) {
    if (ping.sent < e.from || ping.sent >= e.to) continue;
    const Duration there = up.arrival(ping.sent, e.ping_ip_bytes);
    out.expected_ms.push_back(to_ms(down.arrival(there, e.ping_ip_bytes) - ping.sent));
    out.measured_ms.push_back(to_ms(ping.round_trip));
  }
  return out;
}

// The time that a packet needs from NIC to NIC where the link adds no delay: 20 to 60 us
// (docs/constants.md, "The testbed on a machine"), and as much again for the hop to the roadside.
// Where 1 % of a link's delay is less than this, the mean cannot be judged.
constexpr double kMachineMs = 0.1;

// Makes delay figures milder where the machine explains their excess. `passes`: how often a packet
// goes through the emulator (1 one way, 2 for a round trip).
void excuse_lateness(Figure& mean_figure, Figure& error_figure, const Disturbance& d, int passes) {
  // The mean is taken over all links and directions; twice that is allowed for a single one.
  // No measurement is behind the factor 2: it only has to be larger than 1.
  const double late_ms = 2 * d.late_mean_ms * passes;
  if (mean_figure.verdict == Verdict::kFailed) {
    const double beyond = *mean_figure.measured - *mean_figure.target;
    const double bound = *mean_figure.target * kMeanDelayPercent / 100;
    if (beyond > 0 && beyond <= kMachineMs * passes && bound < kMachineMs * passes) {
      mean_figure.verdict = Verdict::kNotMeasured;
      mean_figure.note = "1 % of it is less than the way through this machine takes";
    } else if (beyond > 0 && beyond - late_ms <= bound) {
      inconclusive(mean_figure,
                   fmt::format("the emulator was {:.2f} ms late in the mean", d.late_mean_ms));
    }
  }
  // By Markov's inequality a mean lateness of a hundredth of the bound is the least at which one
  // packet in a hundred can be as late as the bound.
  if (error_figure.verdict == Verdict::kFailed && d.late_max_ms > kDelayErrorP99Ms &&
      late_ms >= kDelayErrorP99Ms / 100) {
    inconclusive(error_figure, fmt::format("the emulator was up to {:.1f} ms late", d.late_max_ms));
  }
}

void add_delays(const std::string& prefix, const Delays& delays, const Disturbance& disturbance,
                int passes, std::vector<Figure>& out) {
  Figure mean_figure = judge_delay_mean(prefix + " mean", delays.expected_ms, delays.measured_ms);
  Figure error_figure =
      judge_delay_error(prefix + " error p99", delays.expected_ms, delays.measured_ms);
  excuse_lateness(mean_figure, error_figure, disturbance, passes);
  out.push_back(std::move(mean_figure));
  out.push_back(std::move(error_figure));
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

void add_loss(const std::string& name, const LinkEvidence& e, Direction direction,
              std::vector<Figure>& out) {
  const DirectionEvidence& d = e.directions[static_cast<std::size_t>(direction)];
  double prescribed = 0;
  std::size_t lost = 0;
  for (const Flow::Packet& p : d.flow.packets) {
    prescribed += e.schedule.loss(direction, p.sent);
    if (!p.arrived) ++lost;
  }
  const std::size_t sent = d.flow.packets.size();
  Figure loss =
      judge_loss(name + " loss", 100 * prescribed / static_cast<double>(sent), percent(lost, sent));
  // The kernel does not tell whose frames it dropped: at worst all of them were of this flow.
  const double dropped = percent(e.disturbance.kernel_drops, sent);
  if (loss.verdict == Verdict::kFailed && *loss.difference > 0 &&
      *loss.difference - dropped <= kLossPoints) {
    inconclusive(loss, fmt::format("the kernel dropped {} frames before the emulator",
                                   e.disturbance.kernel_drops));
  }
  // A link that is right can be beyond the bound by chance when few packets were seen: within three
  // standard deviations, which chance exceeds in 0.3 % of runs, the loss is inconclusive.
  constexpr double kDeviations = 3;
  const double chance =
      100 * chance_of_loss(prescribed / static_cast<double>(sent), d.asked.gilbert_elliott, sent);
  if (loss.verdict == Verdict::kFailed && std::abs(*loss.difference) <= kDeviations * chance) {
    inconclusive(loss, fmt::format("chance makes {:.2f} points of {} packets", chance, sent));
  }
  const auto& c = d.counted;
  const std::uint64_t dropped_by_link =
      c.lost + c.queue_drops + c.outage_lost + c.too_big + c.nat_drops + c.policed;
  Figure own = judge_loss(name + " loss, own count", percent(dropped_by_link, c.packets_in),
                          percent(lost, sent));
  for (Figure* figure : {&loss, &own}) {
    if (sent < kPacketsForVerdict) {
      inconclusive(*figure, fmt::format("{} packets are too few", sent));
    }
    out.push_back(std::move(*figure));
  }
}

void add_bursts(const std::string& name, const LinkEvidence& e, Direction direction,
                std::vector<Figure>& out) {
  const DirectionEvidence& d = e.directions[static_cast<std::size_t>(direction)];
  if (!d.asked.gilbert_elliott || d.flow.packets.empty()) return;
  const Bursts seen = bursts(d.flow, e.schedule, direction);
  const auto sent = static_cast<double>(d.flow.packets.size());
  const double others = std::max(0.0, static_cast<double>(d.counted.packets_in) - sent) / sent;
  Figure figure;
  figure.name = name + " burst length";
  figure.unit = "packets";
  figure.target = expected_burst(*d.asked.gilbert_elliott, 0, std::min(others, 1.0));
  figure.measured = seen.mean;
  figure.difference = 100 * (seen.mean / *figure.target - 1);
  figure.difference_unit = "%";
  figure.note = fmt::format("{} bursts", seen.count);
  if (seen.count >= kBurstsForVerdict) {
    figure.verdict =
        std::abs(*figure.difference) <= kBurstPercent ? Verdict::kOk : Verdict::kFailed;
  }
  out.push_back(std::move(figure));
}

// Judges events that must not happen unless the profile asks for them.
Figure judge_none(std::string name, std::size_t count, bool asked) {
  Figure figure;
  figure.name = std::move(name);
  figure.unit = "packets";
  figure.measured = static_cast<double>(count);
  if (asked) {
    figure.note = "the profile asks for it";
    return figure;
  }
  figure.target = 0;
  figure.verdict = count == 0 ? Verdict::kOk : Verdict::kFailed;
  return figure;
}

// The figure of a flow of which nothing arrived: a failure, unless that is explained.
Figure nothing_came(std::string name, const DirectionEvidence& d, bool outage) {
  if (!d.not_measured.empty()) {
    return without_verdict(std::move(name), d.not_measured, Verdict::kNotMeasured);
  }
  if (outage) return without_verdict(std::move(name), "an outage", Verdict::kNotMeasured);
  return without_verdict(std::move(name), d.failure.empty() ? "nothing came" : d.failure,
                         Verdict::kFailed);
}

void add_flow(const std::string& name, const LinkEvidence& e, Direction direction,
              const Course& course, std::vector<Figure>& out) {
  const DirectionEvidence& d = e.directions[static_cast<std::size_t>(direction)];
  if (std::none_of(d.flow.packets.begin(), d.flow.packets.end(),
                   [](const Flow::Packet& p) { return p.arrived.has_value(); })) {
    out.push_back(nothing_came(name + " delay", d, e.schedule.mostly_out(direction, e.from, e.to)));
    return;
  }
  const std::size_t first = out.size();
  if (delays(d.asked.carrier)) {
    out.push_back(without_verdict(name + " delay", "grants or hybrid ARQ delay packets",
                                  Verdict::kNotMeasured));
  } else {
    add_delays(name + " delay", one_way(d.flow, course), e.disturbance, 1, out);
  }
  add_loss(name, e, direction, out);
  add_bursts(name, e, direction, out);
  out.push_back(judge_none(name + " reordered", d.flow.reordered, d.asked.reorder));
  out.push_back(judge_none(name + " duplicates", d.flow.duplicates, d.asked.duplicate));
  if (e.capture_drops == 0) return;
  for (std::size_t i = first; i < out.size(); ++i) {
    inconclusive(out[i], fmt::format("tcpdump missed {} packets", e.capture_drops));
  }
}

}  // namespace

Figure judge_delay_mean(const std::string& name, const std::vector<double>& expected_ms,
                        const std::vector<double>& measured_ms) {
  Figure figure;
  figure.name = name;
  figure.unit = "ms";
  figure.difference_unit = "%";
  figure.target = mean(expected_ms);
  figure.measured = mean(measured_ms);
  // On a link without delay every measured value is the machine's own overhead, so 1 % of the
  // target is no bound: no verdict.
  if (*figure.target <= 0) return figure;
  figure.difference = 100 * (*figure.measured / *figure.target - 1);
  figure.verdict =
      std::abs(*figure.difference) <= kMeanDelayPercent ? Verdict::kOk : Verdict::kFailed;
  return figure;
}

Figure judge_delay_error(const std::string& name, const std::vector<double>& expected_ms,
                         const std::vector<double>& measured_ms) {
  std::vector<double> errors(expected_ms.size());
  std::transform(expected_ms.begin(), expected_ms.end(), measured_ms.begin(), errors.begin(),
                 [](double expected, double measured) { return std::abs(measured - expected); });
  Figure figure;
  figure.name = name;
  figure.unit = "ms";
  figure.target = kDelayErrorP99Ms;
  figure.measured = percentile(errors, 0.99);
  figure.verdict = *figure.measured <= kDelayErrorP99Ms ? Verdict::kOk : Verdict::kFailed;
  return figure;
}

Figure judge_loss(const std::string& name, double target_percent, double measured_percent) {
  Figure figure;
  figure.name = name;
  figure.unit = "%";
  figure.difference_unit = "points";
  figure.target = target_percent;
  figure.measured = measured_percent;
  figure.difference = measured_percent - target_percent;
  figure.verdict = std::abs(*figure.difference) <= kLossPoints ? Verdict::kOk : Verdict::kFailed;
  return figure;
}

std::vector<Figure> assess(const LinkEvidence& e) {
  std::vector<Figure> out;
  if (!e.schedule.covers(e.from, e.to)) {
    out.push_back(without_verdict("schedule", "the testbed does not tell it for this window",
                                  Verdict::kFailed));
    return out;
  }
  const std::vector<Sent> up_traffic = traffic_of(e.directions[0].flow);
  const std::vector<Sent> down_traffic = traffic_of(e.directions[1].flow);
  const Course up(e.schedule, Direction::kUp, up_traffic);
  const Course down(e.schedule, Direction::kDown, down_traffic);
  const Delays ping = round_trip(e, up, down);
  const bool reordered = e.directions[0].asked.reorder || e.directions[1].asked.reorder;
  const bool delayed =
      delays(e.directions[0].asked.carrier) || delays(e.directions[1].asked.carrier);
  if (ping.measured_ms.size() >= kPingsForVerdict && !reordered && !delayed) {
    add_delays("round trip", ping, e.disturbance, 2, out);
  } else {
    const bool out_of_radio = e.schedule.mostly_out(Direction::kUp, e.from, e.to);
    out.push_back(without_verdict(
        "round trip",
        delayed     ? "grants or hybrid ARQ delay packets"
        : reordered ? "the profile reorders"
                    : fmt::format("{} answers", ping.measured_ms.size()),
        reordered || delayed || out_of_radio ? Verdict::kNotMeasured : Verdict::kFailed));
  }
  for (const auto& [direction, name] : kDirectionsByName) {
    add_flow(name, e, direction, direction == Direction::kUp ? up : down, out);
    out.push_back(judge_rate(std::string(name) + " rate",
                             e.directions[static_cast<std::size_t>(direction)].rate, direction));
    for (Figure& figure : judge_carrier(name, e.directions[static_cast<std::size_t>(direction)],
                                        direction, direction == Direction::kUp ? up : down)) {
      out.push_back(std::move(figure));
    }
  }
  return out;
}

LinkFindings summarise(const std::string& name, const std::string& profile,
                       const LinkEvidence& evidence) {
  LinkFindings out{name, profile, evidence.to - evidence.from, 0, {}, {}, assess(evidence)};
  for (const Ping& ping : evidence.pings.answered) {
    if (ping.sent >= evidence.from && ping.sent < evidence.to) ++out.pings;
  }
  for (std::size_t i = 0; i < out.sent.size(); ++i) {
    const auto& packets = evidence.directions[i].flow.packets;
    out.sent[i] = packets.size();
    out.received[i] = static_cast<std::size_t>(std::count_if(
        packets.begin(), packets.end(), [](const auto& p) { return p.arrived.has_value(); }));
  }
  return out;
}

}  // namespace interneuron::netns::verify
