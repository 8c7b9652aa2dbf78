// Configuration files: TOML whose keys are the long options of a command, with underscores for
// dashes (`deadline_ms = 130` is `--deadline-ms 130`), so that each setting is defined, described
// and checked in one place; links may also be tables (link_options.h). An option on the command
// line wins over the file.
#pragma once

#include <CLI/CLI.hpp>

namespace interneuron::settings {

// Adds --config FILE to a command.
void add_config_option(CLI::App& command);

// Applies the file, if one was given, to the options that the command line did not give. Throws
// Failure(3) with file, line, column and key for malformed TOML, an unknown key or a bad value.
void apply_config(CLI::App& command);

}  // namespace interneuron::settings
