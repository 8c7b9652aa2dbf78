// The delay model of a profile.
#include "lab/emu/delay_trace.h"
#include "lab/emu/profile_reader.h"

namespace interneuron::emu {

namespace {

constexpr NumberKey kRttMin{"rtt_min_ms", "smallest round-trip time", 0, kMaxRttMs, "ms"};
constexpr NumberKey kRttMax{"rtt_max_ms", "largest round-trip time", 0, kMaxRttMs, "ms"};
constexpr NumberKey kRampTau{"ramp_tau_s", "time constant of the ramp between states", 0.001,
                             kMaxSeconds, "s"};
constexpr NumberKey kBadAfterEdge{"bad_after_edge", "probability that EDGE leads to BAD", 0, 1, ""};
constexpr NumberKey kLevel{"level_ms", "mean round-trip time of the state", 0, kMaxRttMs, "ms"};
constexpr NumberKey kLevelSd{"level_sd_ms", "standard deviation of the level over episodes", 0,
                             kMaxRttMs, "ms"};
constexpr NumberKey kWanderSd{"wander_sd_ms", "standard deviation within an episode", 0, kMaxRttMs,
                              "ms"};
constexpr NumberKey kWanderTau{"wander_tau_s", "correlation time within an episode", 0.001,
                               kMaxSeconds, "s"};
constexpr NumberKey kJitterSd{"jitter_sd_ms", "half-normal jitter", 0, kMaxRttMs, "ms"};
constexpr NumberKey kSojournMean{"sojourn_mean_s", "mean duration of the state", 0.01, kMaxSeconds,
                                 "s"};
constexpr NumberKey kSojournShape{"sojourn_shape", "shape of the Gamma-distributed duration", 0.1,
                                  1000, ""};

// The keys that every model has, and those of one.
std::vector<std::string_view> with_common(std::vector<std::string_view> own) {
  std::vector<std::string_view> keys{"schema", "name", "description", "model"};
  keys.insert(keys.end(), own.begin(), own.end());
  keys.insert(keys.end(), {"up", "down", "outages", "nat"});
  return keys;
}

bool read_state(TomlReader& reader, const Section& section, RadioStateParams& out) {
  return reader.only(section, {"level_ms", "level_sd_ms", "wander_sd_ms", "wander_tau_s",
                               "jitter_sd_ms", "sojourn_mean_s", "sojourn_shape", "loss"}) &&
         reader.number(section, kLevel, out.level_ms) &&
         reader.number(section, kLevelSd, out.level_sd_ms) &&
         reader.number(section, kWanderSd, out.ar_sd_ms) &&
         reader.number(section, kWanderTau, out.ar_tau_s) &&
         reader.number(section, kJitterSd, out.jitter_sd_ms) &&
         reader.number(section, kSojournMean, out.sojourn_mean_s) &&
         reader.number(section, kSojournShape, out.sojourn_shape) &&
         reader.number(section, kLossKey, out.loss);
}

bool read_three_state(TomlReader& reader, const Section& root, DelayParams& out) {
  if (!reader.only(root, with_common({"rtt_min_ms", "rtt_max_ms", "ramp_tau_s", "bad_after_edge",
                                      "state"})) ||
      !reader.number(root, kRttMin, out.min_ms) || !reader.number(root, kRttMax, out.max_ms) ||
      !reader.number(root, kRampTau, out.ramp_tau_s) ||
      !reader.number(root, kBadAfterEdge, out.bad_after_edge)) {
    return false;
  }
  if (out.max_ms < out.min_ms) {
    return reader.fail_at(root, kRttMax.name,
                          "'rtt_max_ms' = " + number_text(out.max_ms) +
                              " is below 'rtt_min_ms' = " + number_text(out.min_ms) +
                              "; raise the one or lower the other");
  }
  const Section states = reader.section(root, "state");
  return reader.only(states, {"stable", "edge", "bad"}) &&
         read_state(reader, reader.section(states, "stable"), out.states[0]) &&
         read_state(reader, reader.section(states, "edge"), out.states[1]) &&
         read_state(reader, reader.section(states, "bad"), out.states[2]);
}

bool read_constant(TomlReader& reader, const Section& root, DelayParams& out) {
  double rtt_ms = 0;
  double loss = 0;
  if (!reader.only(root, with_common({"rtt_ms", "loss"})) ||
      !reader.number(root, kRttKey, rtt_ms) || !reader.number(root, kLossKey, loss)) {
    return false;
  }
  out = constant_delay(rtt_ms, loss);
  return true;
}

bool read_trace(TomlReader& reader, const Section& root, const TraceFiles& files,
                DelayParams& out) {
  NumberKey loss_key = kLossKey;
  loss_key.optional = true;
  double loss = 0;
  std::string start = "beginning";
  if (!reader.only(root, with_common({"rtt_trace", "start", "loss"})) ||
      !files.read(reader, root, "rtt_trace", parse_delay_trace, out.trace) ||
      (reader.has(root, "start") && !reader.text(root, "start", "random", start)) ||
      !reader.number(root, loss_key, loss)) {
    return false;
  }
  if (start != "beginning" && start != "random") {
    return reader.fail_at(root, "start",
                          "'start' = \"" + start + "\" must be \"beginning\" or \"random\"");
  }
  out.random_start = start == "random";
  for (RadioStateParams& state : out.states) state.loss = loss;
  out.min_ms = kMaxRttMs;
  for (const double rtt_ms : out.trace->rtt_ms) {
    if (rtt_ms < 0) continue;
    out.min_ms = std::min(out.min_ms, rtt_ms);
    out.max_ms = std::max(out.max_ms, rtt_ms);
  }
  return true;
}

}  // namespace

std::vector<std::string_view> delay_keys() {
  return with_common({"rtt_min_ms", "rtt_max_ms", "ramp_tau_s", "bad_after_edge", "state", "rtt_ms",
                      "loss", "rtt_trace", "start"});
}

bool read_delay(TomlReader& reader, const Section& root, const TraceFiles& files,
                DelayParams& out) {
  std::string model;
  if (!reader.text(root, "model", "three-state", model)) return false;
  if (model == "three-state") return read_three_state(reader, root, out);
  if (model == "constant") return read_constant(reader, root, out);
  if (model == "delay-trace") return read_trace(reader, root, files, out);
  const auto nearest = nearest_word(model, {"three-state", "constant", "delay-trace"});
  return reader.fail_at(
      root, "model",
      "'model' = \"" + model + "\" is not known; " +
          (nearest ? "did you mean \"" + std::string(*nearest) + "\"?"
                   : "there are \"three-state\", \"constant\" and \"delay-trace\""));
}

}  // namespace interneuron::emu
