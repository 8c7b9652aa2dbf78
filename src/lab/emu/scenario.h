// A scenario: links, how they fade together, and what happens to them when. TOML, schema 1, units
// in the names, any other key an error:
//
//   # Source: where it comes from                        line 1, optional
//   schema = 1
//   description = "a tunnel"                           optional
//   seed = 1                                             0 .. 2^63-1, default 1
//   [[link]]                                             1 .. 16
//     name = "5g"                                        1..13 of A-Z a-z 0-9 _ -, unique
//     profile = "5g"                                     found by the caller's resolver
//     seed = 1154                                        of its delay process; default
//                                                        link_seed(scenario's, position)
//     cell = "town"                                      a cell's name; default: none is shared
//   [[cell]]                                             0 .. 16: what links share, see cell.h
//     name = "town"                                      as a link's, unique among cells
//     profile = "generated-cellular"                     its rates, queues and MTUs are the cell's;
//                                                        the rest of it is not used
//     codel_target_ms = 5                                0.1 .. 1000; default: drop-tail only
//     mark_above_ms = 1                                  0 .. 1000; default: no step of marks
//   [coupling]                                           optional, see delay_process.h
//     common_fading = 0.3                                0 .. 1
//   [holes]                                              optional: no link has radio
//     mean_gap_s = 300                                   > 0.1 .. 86400, exponential
//     mean_length_s = 5                                  > 0.01 .. 86400, exponential
//   [[event]]                                            any number, sorted by at_s when read
//     at_s = 60                                          0 .. 10^7 since the first packet
//     link = "5g"                                        a link's name, or "*" for all
//     outage_s = 5                                       > 0 .. 86400, and/or
//     loss = 0.01                                        any key of link_change.h; in a TOML file
//     up.rate_mbit = 2                                   "up.KEY" is a dotted key
//
// Pure; never throws.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "lab/emu/cell.h"
#include "lab/emu/link_change.h"
#include "lab/emu/profile.h"

namespace interneuron::emu {

// One link of the scenario.
struct ScenarioLink {
  std::string name;
  LinkProfile profile;
  // The seed of the link's delay process.
  std::uint64_t seed = 0;
  // The index of the cell that its packets pass, each way, behind the link.
  std::optional<std::size_t> cell{};
};

// A bottleneck that links share, for each direction.
struct ScenarioCell {
  std::string name;
  CellParams up;
  CellParams down;
};

// Something that happens to one link or to all: an outage, a change, or both.
struct ScenarioEvent {
  // Since the first packet.
  Duration at{};
  // The index of a link; empty: all links.
  std::optional<std::size_t> link;
  // 0: none.
  Duration outage{};
  // Changes nothing when it is empty.
  LinkChange change;
};

// Random times at which no link has radio; gaps and lengths are exponentially distributed.
struct CoverageHoles {
  // From the end of one to the beginning of the next; 0: there are none.
  Duration mean_gap{};
  Duration mean_length{};
};

struct Scenario {
  std::string source;
  std::string description;
  std::uint64_t seed = 1;
  std::vector<ScenarioCell> cells;
  std::vector<ScenarioLink> links;
  double common_fading = 0;
  CoverageHoles holes;
  // In order of time; those of one instant in the order of the file.
  std::vector<ScenarioEvent> events;
};

inline constexpr std::size_t kMaxScenarioLinks = 16;
inline constexpr std::size_t kMaxScenarioCells = 16;

// Reads a scenario; `origin` names it in errors. The error is one line with file, line, column, key
// and remedy.
std::variant<Scenario, ProfileError> parse_scenario(
    std::string_view toml_text, std::string_view origin,
    const ProfileResolver& resolver = built_in_resolver());

// A scenario without a file: these links, nothing else.
Scenario plain_scenario(std::vector<ScenarioLink> links, std::uint64_t seed);

}  // namespace interneuron::emu
