// What the commands' command lines share: a check of numbers, and the one line that tells the user
// what is wrong with the arguments. Pure: nothing here prints or ends the program.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace interneuron::settings {

// Accepts a finite number above zero. CLI11's own PositiveNumber refuses with the range of a
// double, whose upper end has 309 digits.
CLI::Validator positive_number();

// One line that says why parse() threw `error` and what to do about it. An unknown option or
// command is named together with the known one that is spelt most like it, as the keys of
// configuration files are. Requires that `program` is the one whose parse() threw.
std::string mistake_in(const CLI::App& program, const CLI::ParseError& error);

// The same for a first argument that is no command of `program`.
std::string unknown_command(const CLI::App& program, const std::string& name);

}  // namespace interneuron::settings
