// The examples of docs/wire_format.md as they stand there: the code blocks that begin with a line
// of bytes in hexadecimal, without what is said beside the bytes. Those of packets in the clear
// come first, then those of a handshake and of what it protects.
#pragma once

#include <fstream>
#include <regex>
#include <string>
#include <vector>

#include "tests/core/wire/examples.h"
#include "tests/places.h"

namespace interneuron::wire {

// How many of them are in the clear.
inline constexpr std::size_t kClearExamples = 10;

inline std::vector<Bytes> examples_of_the_document() {
  std::ifstream in(places::source() + "/docs/wire_format.md");
  const std::regex bytes("    ((?:[0-9a-f]{2} )*[0-9a-f]{2})(?:    .*)?");
  std::vector<Bytes> examples;
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (!std::regex_match(line, match, bytes)) {
      inside = false;
      continue;
    }
    if (!inside) examples.emplace_back();
    inside = true;
    const Bytes more = from_hex(match[1].str());
    examples.back().insert(examples.back().end(), more.begin(), more.end());
  }
  return examples;
}

}  // namespace interneuron::wire
