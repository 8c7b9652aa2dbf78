// [up], [down], [outages] and [nat] of a profile.
#include <algorithm>
#include <array>

#include "lab/emu/profile_reader.h"

namespace interneuron::emu {

namespace {

constexpr NumberKey kStepAt{"at_s", "instant of a step", 0, kMaxInstantS, "s"};
constexpr NumberKey kStepRate{"rate_mbit", "rate from then on", 0, kMaxRateMbit, "Mbit/s"};
constexpr NumberKey kPeriod{"rate_period_s", "period of the steps", 0.001, kMaxInstantS, "s", true};
constexpr NumberKey kGoodToBad{"p", "probability that losses begin", 0, 1, ""};
constexpr NumberKey kBadToGood{"r", "probability that losses end", 0.001, 1, ""};
constexpr NumberKey kLossInGood{"loss_in_good", "loss outside bursts", 0, 1, "", true};
constexpr NumberKey kLossInBad{"loss_in_bad", "loss within bursts", 0, 1, "", true};
constexpr NumberKey kFirst{"first_s", "beginning of the first outage", 0, kMaxInstantS, "s"};
constexpr NumberKey kLength{"length_s", "length of each outage", 0.001, kMaxSeconds, "s"};
constexpr NumberKey kEvery{"every_s", "time from one outage to the next", 0.002, kMaxInstantS, "s",
                           true};
constexpr NumberKey kDropBelow{"drop_below_bytes", "", 0, 65'535, "IP bytes", true, true};
constexpr NumberKey kReorderAbove{"reorder_above_bytes", "", 0, 65'535, "IP bytes", true, true};
constexpr NumberKey kNatReorder{"reorder", "", 0, 1, "", true};
constexpr NumberKey kNatReorderMs{"reorder_ms", "", 0.01, kMaxRttMs, "ms", true};
constexpr NumberKey kIdle{"idle_timeout_s", "", 0.001, kMaxSeconds, "s", true};

// Assumed: the report of reordering by a carrier (quic-go/quic-go issue 5768) gives no delay.
constexpr double kDefaultNatReorderMs = 5;

bool read_steps(TomlReader& reader, const Section& section, DirectionParams& out) {
  std::vector<std::pair<double, double>> pairs;
  double period_s = 0;
  if (!reader.pairs(section, "rate_steps", kStepAt, kStepRate, pairs) ||
      !reader.number(section, kPeriod, period_s)) {
    return false;
  }
  const auto fail = [&](std::string_view key, const std::string& what) {
    return reader.fail_at(section, key,
                          "'" + std::string(key) + "' in [" + section.path + "] " + what);
  };
  SteppedRate stepped;
  bool any = false;
  for (const auto& [at_s, mbit] : pairs) {
    if (stepped.steps.empty() ? at_s != 0 : seconds(at_s) <= stepped.steps.back().at) {
      return fail("rate_steps", "must begin at 0 s and rise; " + number_text(at_s) + " does not");
    }
    stepped.steps.push_back({seconds(at_s), DataRate::mbit(mbit)});
    any = any || stepped.steps.back().rate.bits_per_second > 0;
  }
  if (!any) return fail("rate_steps", "is 0 everywhere; nothing would ever pass");
  stepped.period = seconds(period_s);
  if (period_s > 0 && stepped.period <= stepped.steps.back().at) {
    return fail("rate_period_s", "= " + number_text(period_s) + " must be beyond the last step");
  }
  out.rate = mean_rate(stepped);
  out.trace = std::make_shared<const SteppedRate>(std::move(stepped));
  return true;
}

// Exactly one of rate_mbit, rate_steps and rate_trace. The first is read with the other keys.
bool read_rate(TomlReader& reader, const Section& section, const TraceFiles& files,
               DirectionParams& out) {
  const bool steps = reader.has(section, "rate_steps");
  const bool trace = reader.has(section, "rate_trace");
  if (steps + trace + reader.has(section, kRateKey.name) > 1) {
    return reader.fail_at(
        section, trace ? "rate_trace" : "rate_steps",
        "[" + section.path +
            "] has more than one of rate_mbit, rate_steps and rate_trace; keep one");
  }
  if (!steps && reader.has(section, kPeriod.name)) {
    return reader.fail_at(section, kPeriod.name,
                          "'rate_period_s' in [" + section.path + "] needs 'rate_steps'");
  }
  if ((steps || trace) && out.grant_every > Duration{}) {
    return reader.fail_at(
        section, "grant_ms",
        "'grant_ms' in [" + section.path +
            "] is for a constant rate_mbit; leave it out beside steps and traces");
  }
  if (steps) return read_steps(reader, section, out);
  if (!trace) {
    double mbit = 0;
    // Reports that the key is missing.
    return reader.number(section, kRateKey, mbit);
  }
  std::shared_ptr<const Opportunities> opportunities;
  if (!files.read(reader, section, "rate_trace", parse_opportunities, opportunities)) return false;
  out.rate = mean_rate(*opportunities);
  out.trace = std::move(opportunities);
  return true;
}

bool read_bursts(TomlReader& reader, const Section& section, DirectionParams& out) {
  if (!reader.has(section, "gilbert_elliott")) return true;
  const Section bursts = reader.section(section, "gilbert_elliott");
  GilbertElliott ge;
  if (!reader.only(bursts, {"p", "r", "loss_in_good", "loss_in_bad"}) ||
      !reader.number(bursts, kGoodToBad, ge.p) || !reader.number(bursts, kBadToGood, ge.r) ||
      !reader.number(bursts, kLossInGood, ge.loss_in_good) ||
      !reader.number(bursts, kLossInBad, ge.loss_in_bad)) {
    return false;
  }
  out.gilbert_elliott = ge;
  return true;
}

// A key that says nothing without another one.
bool check_pairs(TomlReader& reader, const Section& section) {
  constexpr std::array<std::array<std::string_view, 2>, 5> kNeeds{{{"police_kbyte", "police_mbit"},
                                                                   {"shape_kbyte", "shape_mbit"},
                                                                   {"grant_share", "grant_ms"},
                                                                   {"harq_ms", "harq"},
                                                                   {"wake_after_ms", "wake_ms"}}};
  for (const auto& [key, other] : kNeeds) {
    if (!reader.has(section, key) || reader.has(section, other)) continue;
    return reader.fail_at(
        section, key,
        "'" + std::string(key) + "' in [" + section.path + "] needs '" + std::string(other) + "'");
  }
  return true;
}

// The default, and that a packet need not wait longer than the delay process remembers: its delay
// is read when it leaves the queue. The slower of bottleneck and shaper empties it.
bool check_queue(TomlReader& reader, const Section& section, DirectionParams& out) {
  const bool shaped = out.shape.rate.bits_per_second > 0;
  const DataRate slower = shaped ? std::min(out.rate, out.shape.rate) : out.rate;
  const double bytes_per_s = static_cast<double>(slower.bits_per_second) / 8;
  const double longest_s = to_seconds(DelayProcess::kMemory);
  const double smallest = kMinQueueKbyte * 1e3;
  if (out.queue_bytes == 0) {
    const double default_s = to_seconds(kDefaultQueueTime);
    out.queue_bytes = static_cast<std::size_t>(std::max(smallest, bytes_per_s * default_s));
  }
  const auto bytes = static_cast<double>(out.queue_bytes);
  if (bytes <= smallest || bytes <= bytes_per_s * longest_s) return true;
  return reader.fail_at(section, "queue_kbyte",
                        "'queue_kbyte' in [" + section.path + "] = " + number_text(bytes / 1e3) +
                            " holds more than " + number_text(longest_s) + " s at " +
                            number_text(slower.mbit()) + " Mbit/s; at most " +
                            number_text(bytes_per_s * longest_s / 1e3));
}

}  // namespace

bool read_direction(TomlReader& reader, const Section& section, const TraceFiles& files,
                    DirectionParams& out) {
  std::vector<std::string_view> known;
  for (const DirectionKey& key : direction_keys()) known.push_back(key.key.name);
  known.insert(known.end(), {"rate_steps", "rate_period_s", "rate_trace", "gilbert_elliott"});
  if (!reader.only(section, known)) return false;
  DirectionChange values;
  for (const DirectionKey& key : direction_keys()) {
    double value = 0;
    if (!reader.number(section, key.key, value)) return false;
    if (reader.has(section, key.key.name)) key.set(values, value);
  }
  values.apply_to(out);
  return check_pairs(reader, section) && read_rate(reader, section, files, out) &&
         read_bursts(reader, section, out) && check_queue(reader, section, out);
}

bool read_outages(TomlReader& reader, const Section& root, PeriodicOutage& out) {
  if (!reader.has(root, "outages")) return true;
  const Section section = reader.section(root, "outages");
  double first_s = 0;
  double length_s = 0;
  double every_s = 0;
  if (!reader.only(section, {"first_s", "length_s", "every_s"}) ||
      !reader.number(section, kFirst, first_s) || !reader.number(section, kLength, length_s) ||
      !reader.number(section, kEvery, every_s)) {
    return false;
  }
  if (every_s > 0 && every_s <= length_s) {
    return reader.fail_at(section, kEvery.name,
                          "'every_s' in [outages] = " + number_text(every_s) +
                              " must be above 'length_s' = " + number_text(length_s));
  }
  out = {seconds(first_s), seconds(length_s), seconds(every_s)};
  return true;
}

bool read_nat(TomlReader& reader, const Section& root, NatParams& out) {
  if (!reader.has(root, "nat")) return true;
  const Section section = reader.section(root, "nat");
  double below = 0;
  double above = 0;
  double reorder_ms = kDefaultNatReorderMs;
  double idle_s = 0;
  if (!reader.only(section, {"drop_below_bytes", "reorder_above_bytes", "reorder", "reorder_ms",
                             "idle_timeout_s"}) ||
      !reader.number(section, kDropBelow, below) || !reader.number(section, kReorderAbove, above) ||
      !reader.number(section, kNatReorder, out.reorder) ||
      !reader.number(section, kNatReorderMs, reorder_ms) ||
      !reader.number(section, kIdle, idle_s)) {
    return false;
  }
  out.drop_below = static_cast<std::size_t>(below);
  out.reorder_above = static_cast<std::size_t>(above);
  out.reorder_delay = from_ms(reorder_ms);
  out.idle_timeout = seconds(idle_s);
  return true;
}

}  // namespace interneuron::emu
