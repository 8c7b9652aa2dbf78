#include "app/watch/glyphs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace interneuron::watch {
namespace {

constexpr std::array kEighths = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array kAscii = {"_", ".", ":", "-", "=", "+", "*", "#"};

}  // namespace

std::string sparkline(const std::deque<double>& values, double top, std::size_t width,
                      bool unicode) {
  const std::size_t count = std::min(values.size(), width);
  std::string out(width - count, ' ');
  const auto& glyphs = unicode ? kEighths : kAscii;
  for (std::size_t i = values.size() - count; i < values.size(); ++i) {
    if (values[i] < 0) {
      out += ' ';
      continue;
    }
    const double level = top > 0 ? values[i] / top * static_cast<double>(glyphs.size() - 1) : 0;
    const auto index = static_cast<std::size_t>(std::lround(std::max(0.0, level)));
    out += glyphs[std::min(index, glyphs.size() - 1)];
  }
  return out;
}

std::string bar(double share, std::size_t width, bool unicode) {
  static constexpr std::array kParts = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉"};
  const double filled = std::clamp(share, 0.0, 1.0) * static_cast<double>(width);
  auto whole = static_cast<std::size_t>(filled);
  if (!unicode) {
    whole = static_cast<std::size_t>(std::lround(filled));
    return std::string(whole, '#') + std::string(width - whole, '.');
  }
  std::string out;
  for (std::size_t i = 0; i < whole; ++i) out += "█";
  std::size_t used = whole;
  if (used < width) {
    const auto part = static_cast<std::size_t>((filled - static_cast<double>(whole)) * 8);
    if (part > 0) {
      out += kParts[part];
      ++used;
    }
  }
  for (; used < width; ++used) out += "·";
  return out;
}

// Column for column.
std::string ascii(const std::string& text) {
  static const std::map<std::string, char> known = {{"–", '-'}, {"…", '~'}, {"≤", '<'}};
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    std::size_t end = i + 1;
    while (end < text.size() && (text[end] & 0xc0) == 0x80) ++end;
    const auto found = known.find(text.substr(i, end - i));
    out += end - i == 1 ? text[i] : found != known.end() ? found->second : '?';
    i = end;
  }
  return out;
}

}  // namespace interneuron::watch
