#include "app/process/status_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace interneuron::process {
namespace {

// ECMA-48: CUU moves the cursor up, ED erases from the cursor to the end of the screen.
std::string erased(std::size_t lines_down) {
  return (lines_down > 0 ? fmt::format("\x1b[{}A", lines_down) : "") + "\r\x1b[J";
}

}  // namespace

StatusLine::StatusLine() : live_(::isatty(STDERR_FILENO) == 1) {}

void StatusLine::show(std::string_view text) {
  if (!live_) return;
  fmt::print(stderr, "{}{}", erased(lines_down_), text);
  std::fflush(stderr);
  shown_ = true;
  lines_down_ = static_cast<std::size_t>(std::ranges::count(text, '\n'));
}

void StatusLine::clear() {
  if (shown_) fmt::print(stderr, "{}", erased(lines_down_));
  std::fflush(stderr);
  shown_ = false;
  lines_down_ = 0;
}

void StatusLine::keep() {
  if (shown_) fmt::print(stderr, "\n");
  std::fflush(stderr);
  shown_ = false;
  lines_down_ = 0;
}

}  // namespace interneuron::process
