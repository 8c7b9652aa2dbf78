// docs/wire_format.md is the authority: its examples are the ones that the other tests check.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include "tests/core/wire/examples.h"

namespace interneuron::wire {
namespace {

// The code blocks that begin with a line of 16 bytes in hexadecimal, without what is said beside
// the bytes.
std::vector<Bytes> examples_of_the_document() {
  std::ifstream in(INTERNEURON_SOURCE_DIR "/docs/wire_format.md");
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

TEST(WireDocument, ShowsOnePacketOfEachKind) {
  const std::vector<Bytes> expected{from_hex(kDataExample),      from_hex(kPlainExample),
                                    from_hex(kRepairExample),    from_hex(kFeedbackExample),
                                    from_hex(kProbeExample),     from_hex(kEchoRequestExample),
                                    from_hex(kEchoReplyExample), from_hex(kWindowExample),
                                    from_hex(kChallengeExample), from_hex(kTokenExample)};
  EXPECT_EQ(examples_of_the_document(), expected);
}

}  // namespace
}  // namespace interneuron::wire
