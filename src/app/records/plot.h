// Pictures by gnuplot, which is started for each, reads its script from us and gives us the
// picture: it opens no file, and nothing but the script says what it does. A script is a program
// that may start others, so each text in it that somebody else has chosen goes through
// gnuplot_text(). Not pure; thread-compatible.
#pragma once

#include <filesystem>
#include <string>

namespace interneuron::records {

// Text as a gnuplot string in single quotes, in which nothing is expanded. Single quotes become
// apostrophes; control characters, which would end the line or the string, become spaces.
std::string gnuplot_text(const std::string& text);

// Runs a script of gnuplot that sets a terminal and no output. Returns the picture; throws
// process::Failure (1) that names `file`, whose picture it is, when it cannot be drawn. Empty (and
// a line on stderr) when gnuplot is not installed.
std::string picture_of(const std::filesystem::path& file, const std::string& gnuplot_script);
// The same, written to `file` whole or not at all; false when gnuplot is not installed.
bool draw(const std::filesystem::path& file, const std::string& gnuplot_script);

}  // namespace interneuron::records
