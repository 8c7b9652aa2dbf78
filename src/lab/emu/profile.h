// A network condition as a file of tc_profiles/: what the simulator and the user-space emulator
// read alike. TOML, schema 1; units are in the names; any other key is an error. Keys without
// "default" must be there; ranges are inclusive and wide: they catch slips of pen and units.
//
//   # Source: where the figures come from     line 1, becomes LinkProfile::source
//   schema = 1
//   name = "5g"                               1..64 characters of A-Z a-z 0-9 _ -
//   description = "5G while driving"          one line
//   model = "three-state"                     or "constant" or "delay-trace"
//
//   three-state
//     rtt_min_ms, rtt_max_ms                  clip, 0..60000 ms, min <= max
//     ramp_tau_s                              between episodes, 0.001..86400 s
//     bad_after_edge                          probability, 0..1
//     [state.stable] [state.edge] [state.bad]
//       level_ms, level_sd_ms                 of an episode, round trip, 0..60000 ms
//       wander_sd_ms, wander_tau_s            within it, 0..60000 ms, 0.001..86400 s
//       jitter_sd_ms                          half-normal per 10 ms, 0..60000 ms
//       sojourn_mean_s, sojourn_shape         Gamma, 0.01..86400 s, 0.1..1000
//       loss                                  per packet and direction, 0..1
//   constant
//     rtt_ms                                  0..60000 ms
//     loss                                    0..1
//   delay-trace
//     rtt_trace = "traces/x.rtt"              see delay_trace.h; relative to the profile's folder
//     start = "beginning"                     default; or "random": where the seed says
//     loss                                    0..1, default 0
//
//   [up] [down]                               vehicle -> roadside, roadside -> vehicle
//     rate_mbit                               10^6 bit/s of IP packets, 0.001..100000; or instead
//     rate_steps = [[0, 30], [60, 5]]         [at_s, rate_mbit], at_s from 0 rising to 10^7,
//                                             rate 0..100000, not all 0
//     rate_period_s                           the steps repeat, > last at_s, ..10^7; default: the
//                                             last rate stays; or instead
//     rate_trace = "traces/x.mahi"            Mahimahi's opportunities, see bottleneck.h
//     queue_kbyte                             drop-tail, 10^3 bytes, 1.5..10^7 and at most 10 s at
//                                             the mean rate; default 300 ms at that rate
//     queue_packets                           drop-tail, too, 1..10^7; default: only bytes count
//     loss                                    0..1; default: that of the radio state
//     duplicate, corrupt, reorder             probability per packet, 0..1, default 0
//     reorder_ms                              how much earlier a reordered packet arrives,
//                                             0.01..60000 ms; default: its whole delay, as netem
//     mtu                                     IP bytes, larger packets vanish, 68..65535; default
//                                             none
//     police_mbit                             token bucket that drops what exceeds it, in front of
//                                             the queue, 0..100000; default 0 = none
//     police_kbyte                            its depth, 1.5..10^7; default 50 ms at police_mbit
//     shape_mbit, shape_kbyte                 the same, but what exceeds it waits: bursts pass at
//                                             rate_mbit, the rest at shape_mbit
//     grant_ms                                packets leave in grants only, one each so many ms,
//                                             0..1000, default 0 = at any time; not with steps and
//                                             traces, which can say it themselves
//     grant_share                             part of that time for which a grant lasts, at
//                                             rate_mbit / grant_share, 0.001..1, default 0.2
//     harq                                    probability that the radio sends a packet again,
//                                             each of three times; others wait behind it, default 0
//     harq_ms                                 how long each takes, 0.01..9000 ms, default 8
//     wake_ms                                 what comes after a silence of both directions waits
//                                             for so long, 0..9000 ms, default 0
//     wake_after_ms                           how long a silence, 1..3600000 ms, default 10000
//     [up.gilbert_elliott]                    bursts of loss beside `loss`; default none
//       p, r                                  good to bad, bad to good, per packet, 0..1, 0.001..1
//       loss_in_good, loss_in_bad             0..1, default 0 and 1
//   [outages]                                 times without radio, default none
//     first_s                                 0..10^7 s
//     length_s                                0.001..86400 s
//     every_s                                 > length_s, ..10^7 s; default: once
//   [nat]                                     what carriers' NATs and tunnels do, default nothing
//     drop_below_bytes                        IP bytes, smaller packets vanish, 0..65535, default 0
//     reorder_above_bytes                     IP bytes, 0..65535, default 0 = off; larger ones are
//     reorder, reorder_ms                     late with this probability, 0..1 (default 0) by this
//                                             time, 0.01..60000 ms (default 5)
//     idle_timeout_s                          no packet up for so long: none comes down, 0.001..
//                                             86400 s; default: never
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "lab/emu/conditions.h"
#include "lab/emu/delay_process.h"

namespace interneuron::emu {

struct LinkProfile {
  // For example "5g".
  std::string name;
  // One line each; the source is from line 1 of the file and empty when that is no comment.
  std::string description;
  std::string source;
  DelayParams delay;
  // Up is from the vehicle to the roadside.
  DirectionParams up;
  DirectionParams down;
  PeriodicOutage outages;
  NatParams nat;

  const DirectionParams& direction(Direction d) const { return d == Direction::kUp ? up : down; }
};

// A link with a constant delay and rates up and down in Mbit/s, whose queues hold far more than
// congestion control fills. `loss` is per packet and direction.
LinkProfile constant_link(std::string name, double rtt_ms, double up_mbit, double down_mbit,
                          double loss = 0);

// The queue of a direction whose file names none: 300 ms at its rate, within the 0.1 to 1 s that
// cellular base stations are known to buffer. Assumed, not in the paper's table.
inline constexpr Duration kDefaultQueueTime = std::chrono::milliseconds(300);

// What is wrong with a profile, a scenario or a change: one line with file, line, column, key and
// remedy.
struct ProfileError {
  std::string what;
};

// Why a file could not be read, as the system says it: "No such file or directory".
struct FileError {
  std::string reason;
};
// Loads a file that a profile names, relative to the profile's own folder. Pure code opens no file
// itself. May throw; then the profile cannot be read.
using FileLoader = std::function<std::variant<std::string, FileError>(const std::string& name)>;

// Parses the text of a profile. `origin` names it in errors. Trace files come from `loader`, and
// when that has none of that name, or is empty, from the traces that are compiled in: so a copy of
// a built-in profile works anywhere. Never throws.
std::variant<LinkProfile, ProfileError> parse_profile(std::string_view toml_text,
                                                      std::string_view origin,
                                                      const FileLoader& loader = nullptr);

// The files of tc_profiles/, compiled in, so that a program finds them wherever it is installed.
struct BuiltInProfile {
  // The name of its file without the ending: "5g".
  std::string_view name;
  // "tc_profiles/5g.toml", for errors.
  std::string_view origin;
  std::string_view text;
};
// In the order of their names.
std::span<const BuiltInProfile> built_in_profiles();

struct BuiltInTrace {
  // As profiles name it: "traces/lte-sprint-highway.rtt", "traces/generated-cellular-up.mahi".
  std::string_view name;
  std::string_view text;
};
std::span<const BuiltInTrace> built_in_traces();

// The built-in profile of this name, if there is one. (They are valid: a test parses them all.)
std::optional<LinkProfile> built_in_profile(std::string_view name);

// Finds a profile by what a user wrote: a name, or whatever else the caller understands.
using ProfileResolver =
    std::function<std::variant<LinkProfile, ProfileError>(const std::string& name)>;
// Knows the built-in ones; the error lists them.
ProfileResolver built_in_resolver();

// The seed of one link's process, derived from the testbed's seed and the link's position, so that
// links are independent and each keeps its process when another is added.
std::uint64_t link_seed(std::uint64_t testbed_seed, std::size_t link_index);

}  // namespace interneuron::emu
