// docs/wire_format.md is the authority: its examples are the ones that the other tests check.
#include "tests/core/wire/document.h"

#include <gtest/gtest.h>

namespace interneuron::wire::document_test {
namespace {

TEST(WireDocument, ShowsOnePacketOfEachKind) {
  const std::vector<Bytes> expected{from_hex(kDataExample),      from_hex(kPlainExample),
                                    from_hex(kRepairExample),    from_hex(kFeedbackExample),
                                    from_hex(kProbeExample),     from_hex(kEchoRequestExample),
                                    from_hex(kEchoReplyExample), from_hex(kWindowExample),
                                    from_hex(kChallengeExample), from_hex(kTokenExample)};
  std::vector<Bytes> shown = examples_of_the_document();
  ASSERT_GE(shown.size(), kClearExamples);
  shown.resize(kClearExamples);
  EXPECT_EQ(shown, expected);
}

}  // namespace
}  // namespace interneuron::wire::document_test
