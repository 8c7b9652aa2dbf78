// The live view of links as lines of styled text: what `interneuron top` puts on the terminal. Pure
// but for the time zone; a terminal is somebody else's.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/watch/history.h"

namespace interneuron::cli {

enum class Style : std::uint8_t { kPlain, kDim, kBold, kTitle, kAccent, kGood, kWarn, kBad };

struct Span {
  std::string text;  // UTF-8, one column per character
  Style style = Style::kPlain;
};
using Line = std::vector<Span>;

struct Canvas {
  std::size_t width = 100;
  std::size_t height = 0;  // 0: as many lines as it takes
  bool unicode = true;     // false: sparklines and bars of ASCII
};

// At most `height` lines of at most `width` columns. Links that do not fit are counted in a line.
std::vector<Line> draw(const LinksHistory& history, const Canvas& canvas);

// Without styles, trailing blanks removed.
std::string plain_text(const std::vector<Line>& lines);

}  // namespace interneuron::cli
