#include "emu/profile.h"

#include <algorithm>
#include <exception>
#include <string>

#include "emu/toml_reader.h"

namespace interneuron::emu {

namespace {

using Section = TomlReader::Section;

constexpr std::int64_t kSchema = 1;

// Ranges are wide: they catch slips of the pen and of units, not unlikely networks.
constexpr double kMaxRttMs =
    60'000;  // a minute; DelayProcess::kMemory bounds only how far back one may ask
constexpr double kMaxSeconds = 86'400;  // a day
constexpr double kMinRateMbit = 0.001;
constexpr double kMaxRateMbit = 100'000;
constexpr double kMinQueueKbyte = 1.5;  // one Ethernet packet
constexpr double kMaxQueueKbyte = 10'000'000;

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
constexpr NumberKey kLoss{"loss", "probability that a packet is lost", 0, 1, ""};
constexpr NumberKey kRtt{"rtt_ms", "round-trip time", 0, kMaxRttMs, "ms"};
constexpr NumberKey kRate{"rate_mbit", "rate of IP packets", kMinRateMbit, kMaxRateMbit, "Mbit/s"};
constexpr NumberKey kQueue{"queue_kbyte",  "drop-tail limit", kMinQueueKbyte,
                           kMaxQueueKbyte, "10^3 bytes",      true};

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
         reader.number(section, kLoss, out.loss);
}

bool read_three_state(TomlReader& reader, const Section& root, DelayParams& out) {
  if (!reader.only(root, {"schema", "name", "description", "model", "rtt_min_ms", "rtt_max_ms",
                          "ramp_tau_s", "bad_after_edge", "state", "up", "down"}) ||
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
  RadioStateParams only_state;
  only_state.sojourn_mean_s = kMaxSeconds;
  if (!reader.only(root,
                   {"schema", "name", "description", "model", "rtt_ms", "loss", "up", "down"}) ||
      !reader.number(root, kRtt, only_state.level_ms) ||
      !reader.number(root, kLoss, only_state.loss)) {
    return false;
  }
  out.states.fill(only_state);
  out.min_ms = out.max_ms = only_state.level_ms;
  return true;
}

bool read_direction(TomlReader& reader, const Section& section, DirectionParams& out) {
  double rate_mbit = 0;
  double queue_kbyte = 0;
  if (!reader.only(section, {"rate_mbit", "queue_kbyte"}) ||
      !reader.number(section, kRate, rate_mbit) || !reader.number(section, kQueue, queue_kbyte)) {
    return false;
  }
  out.rate = DataRate::mbit(rate_mbit);
  const double bytes_per_s = rate_mbit * 1e6 / 8;
  const double default_bytes = std::max(
      kMinQueueKbyte * 1e3, bytes_per_s * std::chrono::duration<double>(kDefaultQueueTime).count());
  const double bytes = queue_kbyte > 0 ? queue_kbyte * 1e3 : default_bytes;
  // A packet's delay is read when it leaves the queue, so the process must remember that far back.
  const double memory_s = std::chrono::duration<double>(DelayProcess::kMemory).count();
  if (bytes > kMinQueueKbyte * 1e3 && bytes / bytes_per_s > memory_s) {
    return reader.fail_at(section, kQueue.name,
                          "'queue_kbyte' in [" + section.path + "] = " + number_text(queue_kbyte) +
                              " holds more than " + number_text(memory_s) + " s at " +
                              number_text(rate_mbit) + " Mbit/s; at most " +
                              number_text(bytes_per_s * memory_s / 1e3));
  }
  out.queue_bytes = static_cast<std::size_t>(bytes);
  return true;
}

bool read_name(TomlReader& reader, const Section& root, std::string& out) {
  if (!reader.text(root, "name", "5g", out)) return false;
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  if (!out.empty() && out.size() <= 64 && std::all_of(out.begin(), out.end(), allowed)) return true;
  return reader.fail_at(root, "name",
                        "'name' = \"" + out + "\" must have 1 to 64 characters of A-Z a-z 0-9 _ -");
}

bool read_schema(TomlReader& reader, const Section& root) {
  double schema = 0;
  const NumberKey key{"schema", "version of this format", 1, 1e6, ""};
  if (!reader.number(root, key, schema)) return false;
  if (schema == static_cast<double>(kSchema)) return true;
  return reader.fail_at(root, "schema",
                        "'schema' = " + number_text(schema) +
                            " is not known here; this program reads schema " +
                            std::to_string(kSchema));
}

bool read_profile(TomlReader& reader, std::string_view text, LinkProfile& out) {
  const Section root{reader.parse(text), ""};
  std::string model;
  // The keys of all models first, so that a slip in 'model' itself is named as such.
  if (!reader.only(
          root, {"schema", "name", "description", "model", "rtt_min_ms", "rtt_max_ms", "ramp_tau_s",
                 "bad_after_edge", "state", "rtt_ms", "loss", "up", "down"}) ||
      !read_schema(reader, root) || !reader.text(root, "model", "three-state", model)) {
    return false;
  }
  if (model == "three-state") {
    if (!read_three_state(reader, root, out.delay)) return false;
  } else if (model == "constant") {
    if (!read_constant(reader, root, out.delay)) return false;
  } else {
    const auto nearest = nearest_word(model, {"three-state", "constant"});
    return reader.fail_at(root, "model",
                          "'model' = \"" + model + "\" is not known; " +
                              (nearest ? "did you mean \"" + std::string(*nearest) + "\"?"
                                       : "there are \"three-state\" and \"constant\""));
  }
  return read_name(reader, root, out.name) &&
         reader.text(root, "description", "5G while driving", out.description) &&
         read_direction(reader, reader.section(root, "up"), out.up) &&
         read_direction(reader, reader.section(root, "down"), out.down);
}

// "Paper, table 1" of "# Source: Paper, table 1".
std::string source_of(std::string_view text) {
  std::string_view line = text.substr(0, text.find('\n'));
  if (line.empty() || line[0] != '#') return "";
  const std::size_t start = line.find_first_not_of("# \t");
  if (start == std::string_view::npos) return "";
  line.remove_prefix(start);
  constexpr std::string_view kPrefix = "Source: ";
  if (line.substr(0, kPrefix.size()) == kPrefix) line.remove_prefix(kPrefix.size());
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  return std::string(line);
}

// One output of SplitMix64 (Steele, Lea, Flood 2014): spreads near seeds over all 64 bits.
std::uint64_t split_mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

}  // namespace

std::variant<LinkProfile, ProfileError> parse_profile(std::string_view toml_text,
                                                      std::string_view origin) {
  try {
    TomlReader reader(origin);
    LinkProfile profile;
    profile.source = source_of(toml_text);
    if (read_profile(reader, toml_text, profile)) return profile;
    return ProfileError{reader.error().value_or(std::string(origin) + ": cannot be read")};
  } catch (const std::exception& error) {  // out of memory in toml++
    return ProfileError{std::string(origin) + ": cannot be read: " + error.what()};
  }
}

std::optional<LinkProfile> built_in_profile(std::string_view name) {
  for (const BuiltInProfile& candidate : built_in_profiles()) {
    if (candidate.name != name) continue;
    auto parsed = parse_profile(candidate.text, candidate.origin);
    if (auto* profile = std::get_if<LinkProfile>(&parsed)) return std::move(*profile);
  }
  return std::nullopt;
}

std::uint64_t link_seed(std::uint64_t testbed_seed, std::size_t link_index) {
  return split_mix(split_mix(testbed_seed) + link_index);
}

DuplexLink make_link(const LinkProfile& profile, std::uint64_t seed) {
  auto process = std::make_shared<DelayProcess>(profile.delay, seed);
  return {process, LinkModel(profile.up, process, split_mix(seed ^ 1U)),
          LinkModel(profile.down, process, split_mix(seed ^ 2U))};
}

}  // namespace interneuron::emu
