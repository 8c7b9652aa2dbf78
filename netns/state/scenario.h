// Finds scenarios and profiles by name or file. Reads files; otherwise without state, thread-safe.
// Errors: TestbedError, 3 with file, line, column and key for a mistake in a file, 2 for a name of
// the caller's that is no profile.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lab/emu/scenario.h"

namespace interneuron::netns {

// The built-in profiles "5g" and "4g", in this order. The NIC of a link is called "if" + its name
// in vehicles and roadside units, so names have 1..13 characters of [A-Za-z0-9_-] (IFNAMSIZ allows
// 15).
emu::Scenario default_scenario(std::uint64_t seed = 1);

// A scenario with one link for each entry of `links`: the name of a built-in profile ("5g"), the
// path of a TOML file, or NAME= and either, which names the link.
emu::Scenario scenario_of(const std::vector<std::string>& links, std::uint64_t seed);

// The scenario in this file, with `seed` in place of the file's if it is given.
emu::Scenario load_scenario(const std::filesystem::path& file,
                            std::optional<std::uint64_t> seed = std::nullopt);

// Whether this means a file (it has a slash, or ends in .toml) rather than a built-in profile.
bool is_profile_file(const std::string& what);

// For emu's parsers: finds a profile by the name of a built-in one or by a path relative to
// `folder`.
emu::ProfileResolver profile_resolver(const std::filesystem::path& folder);

}  // namespace interneuron::netns
