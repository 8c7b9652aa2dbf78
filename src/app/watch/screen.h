// The live view of links as lines of styled text, which `interneuron top` puts on the terminal. No
// terminal is touched here. Pure except that local times depend on the system's time zone;
// thread-compatible; no errors.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/watch/history.h"

namespace interneuron::watch {

enum class Style : std::uint8_t { kPlain, kDim, kBold, kTitle, kAccent, kGood, kWarn, kBad };

struct Span {
  // UTF-8 of which each character takes one column.
  std::string text;
  Style style = Style::kPlain;
};
using Line = std::vector<Span>;

struct Canvas {
  std::size_t width = 100;
  // 0: as many lines as are needed.
  std::size_t height = 0;
  // false: sparklines and bars consist of ASCII characters.
  bool unicode = true;
};

// Draws at most `height` lines of at most `width` columns. One line says how many links did not
// fit.
std::vector<Line> draw(const LinksHistory& history, const Canvas& canvas);

// The lines without styles and without trailing blanks.
std::string plain_text(const std::vector<Line>& lines);

}  // namespace interneuron::watch
