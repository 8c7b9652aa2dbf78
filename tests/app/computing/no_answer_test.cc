#include "app/computing/no_answer.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

namespace interneuron::computing::no_answer_test {
namespace {

TEST(NoAnswer, SaysWhichRoundAndWhy) {
  for (const NoAnswer why : {NoAnswer::kCrowdedOut, NoAnswer::kTooLate, NoAnswer::kUnreadable}) {
    const RoundRef round{SessionId{0xFEDCBA98}, PipelineId{200}, RoundId{0x80000001}};
    const Bytes bytes = encode_no_answer({round, PeerId{4}, why});
    EXPECT_EQ(bytes.size(), 16u);
    const auto back = parse_no_answer(bytes);
    ASSERT_TRUE(back);
    EXPECT_EQ(back->round, round);
    EXPECT_EQ(back->why, why);
  }
}

TEST(NoAnswer, IsOfExactlyOneSize) {
  Bytes bytes = encode_no_answer({});
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    EXPECT_FALSE(parse_no_answer(ByteView(bytes).first(n))) << n;
  }
  bytes.push_back({});
  EXPECT_FALSE(parse_no_answer(bytes));
}

TEST(NoAnswer, OtherMagicsVersionsAndReasonsAreRefused) {
  for (const std::size_t at : {0U, 1U, 2U, 3U, 9U, 10U, 11U}) {
    Bytes bytes = encode_no_answer({});
    bytes[at] ^= std::byte{0x80};
    EXPECT_FALSE(parse_no_answer(bytes)) << at;
  }
}

RC_GTEST_PROP(NoAnswer, AnyBytesAreSafeAndWhatIsReadIsWrittenAlike, ()) {
  Bytes bytes = encode_no_answer({});
  for (std::byte& b : bytes) {
    if (*rc::gen::inRange(0, 4) == 0) b = static_cast<std::byte>(*rc::gen::inRange(0, 256));
  }
  if (const auto read = parse_no_answer(bytes)) RC_ASSERT(encode_no_answer(*read) == bytes);
}

}  // namespace
}  // namespace interneuron::computing::no_answer_test
