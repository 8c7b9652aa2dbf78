// Scenarios and profiles by name or file, for users of a testbed.
// Errors: TestbedError (3) that names file, line, column and key.
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

// Links named and conditioned by `links`, each the name of a built-in profile ("5g"), or the path
// of a TOML file, or NAME=either. Throws TestbedError (3) that names file, line, column and key.
emu::Scenario scenario_of(const std::vector<std::string>& links, std::uint64_t seed);

// The scenario in this file; `seed` instead of the file's, if given. Throws likewise.
emu::Scenario load_scenario(const std::filesystem::path& file,
                            std::optional<std::uint64_t> seed = std::nullopt);

// Finds a profile by the name of a built-in one or by path, relative to `folder`; for emu's
// parsers.
emu::ProfileResolver profile_resolver(const std::filesystem::path& folder);

}  // namespace interneuron::netns
