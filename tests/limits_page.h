// The tables of limits in docs/limits.md and docs/computing.md, and their figures as text.
#pragma once

#include <chrono>
#include <cstddef>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "tests/places.h"

namespace interneuron::limits_page {

// The figure (second cell) of each row of the page's tables, by what names the limit in the cell
// `key`: the first thing in backquotes there.
inline std::map<std::string, std::string> figures_of(const std::string& page, std::size_t key) {
  std::ifstream in(places::source() + page);
  std::map<std::string, std::string> out;
  for (std::string line; std::getline(in, line);) {
    std::vector<std::string> cells;
    for (std::size_t from = 1, to = 0; (to = line.find('|', from)) != std::string::npos;) {
      cells.push_back(line.substr(from + 1, to - from - 2));
      from = to + 1;
    }
    if (line.empty() || line[0] != '|' || cells.size() <= key) continue;
    const std::size_t from = cells[key].find('`');
    if (from == std::string::npos) continue;
    out[cells[key].substr(from + 1, cells[key].find('`', from + 1) - from - 1)] = cells[1];
  }
  return out;
}

// 16384: "16,384".
inline std::string grouped(std::size_t value) {
  std::string out = std::to_string(value);
  for (std::ptrdiff_t at = static_cast<std::ptrdiff_t>(out.size()) - 3; at > 0; at -= 3) {
    out.insert(static_cast<std::size_t>(at), ",");
  }
  return out;
}

// A value with two digits behind the point and a unit; whole ones without: "8.06 MiB", "8 MiB".
inline std::string figure(std::size_t value, std::size_t unit, const char* name) {
  const std::size_t hundredths = (value * 100 + unit / 2) / unit;
  std::string out = std::to_string(hundredths / 100);
  if (hundredths % 100 > 0) {
    out += hundredths % 100 < 10 ? ".0" : ".";
    out += std::to_string(hundredths % 100);
  }
  return out + " " + name;
}

inline std::string mebibytes(std::size_t bytes) { return figure(bytes, 1024 * 1024, "MiB"); }

inline std::string seconds(Duration time) {
  return std::to_string(std::chrono::duration_cast<std::chrono::seconds>(time).count()) + " s";
}

}  // namespace interneuron::limits_page
