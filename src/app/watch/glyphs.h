// Small pictures of characters. Pure.
#pragma once

#include <deque>
#include <string>

namespace interneuron::cli {

// One character per value, scaled to `top`; blanks for what was not measured, and on the left.
std::string sparkline(const std::deque<double>& values, double top, std::size_t width,
                      bool unicode);
// A bar of `share` in [0, 1].
std::string bar(double share, std::size_t width, bool unicode);

// UTF-8 as ASCII, column for column.
std::string ascii(const std::string& text);

}  // namespace interneuron::cli
