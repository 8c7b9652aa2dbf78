// Small pictures made of characters, for `interneuron top`. Pure; thread-safe; no errors.
#pragma once

#include <deque>
#include <string>

namespace interneuron::watch {

// One character for each of the newest `width` values, with `top` as the full height. A negative
// value was not measured and becomes a blank; with fewer values than `width` there are blanks on
// the left.
std::string sparkline(const std::deque<double>& values, double top, std::size_t width,
                      bool unicode);
// A bar of `share` in [0, 1].
std::string bar(double share, std::size_t width, bool unicode);

// UTF-8 text as ASCII with the same number of columns.
std::string ascii(const std::string& text);

}  // namespace interneuron::watch
