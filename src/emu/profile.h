// A network condition as a file of tc_profiles/: what the simulator and the user-space emulator
// read alike.
//
// The file (TOML, schema 1; units are in the names; any other key is an error):
//
//   # Source: where the figures come from                  line 1, becomes LinkProfile::source
//   schema = 1
//   name = "5g"                                             1..64 characters of A-Z a-z 0-9 _ -
//   description = "5G while driving"
//   model = "three-state"                                   or "constant"
//   rtt_min_ms, rtt_max_ms, ramp_tau_s, bad_after_edge      three-state: DelayParams
//   [state.stable] [state.edge] [state.bad]                 three-state: RadioStateParams
//     level_ms, level_sd_ms, wander_sd_ms, wander_tau_s, jitter_sd_ms, sojourn_mean_s,
//     sojourn_shape, loss
//   rtt_ms, loss                                            constant
//   [up] [down]                                             vehicle -> roadside, roadside ->
//   vehicle
//     rate_mbit                                             10^6 bit/s of IP packets
//     queue_kbyte                                           10^3 bytes; optional: 300 ms worth of
//     rate_mbit
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "emu/delay_process.h"
#include "emu/link_model.h"

namespace interneuron::emu {

struct LinkProfile {
  std::string name;         // "5g"
  std::string description;  // one line
  std::string source;       // from line 1 of the file; empty when that is no comment
  DelayParams delay;
  DirectionParams up;    // vehicle -> roadside
  DirectionParams down;  // roadside -> vehicle
};

// The queue of a direction whose file names none: 300 ms at its rate, within the 0.1 to 1 s that
// cellular base stations are known to buffer. Assumed, not in the paper's table.
inline constexpr Duration kDefaultQueueTime = std::chrono::milliseconds(300);

// What is wrong with a profile: one line with file, line, column, key and remedy.
struct ProfileError {
  std::string what;
};

// Parses the text of a profile. `origin` names it in errors. An unknown key is an error. Never
// throws.
std::variant<LinkProfile, ProfileError> parse_profile(std::string_view toml_text,
                                                      std::string_view origin);

// The files of tc_profiles/, compiled in, so that a program finds them wherever it is installed.
struct BuiltInProfile {
  std::string_view name;    // "5g": the name of its file
  std::string_view origin;  // "tc_profiles/5g.toml"
  std::string_view text;
};
std::span<const BuiltInProfile> built_in_profiles();

// The built-in profile of this name, if there is one. (They are valid: a test parses them all.)
std::optional<LinkProfile> built_in_profile(std::string_view name);

// Seed of one link's process from the testbed's seed and the link's position, so that links are
// independent and each keeps its process when another is added.
std::uint64_t link_seed(std::uint64_t testbed_seed, std::size_t link_index);

// Both directions of a link with one shared process.
struct DuplexLink {
  std::shared_ptr<DelayProcess> process;
  LinkModel up;
  LinkModel down;
};
DuplexLink make_link(const LinkProfile& profile, std::uint64_t seed);

}  // namespace interneuron::emu
