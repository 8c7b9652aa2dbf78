#include "core/wire/round_header.h"

#include <gtest/gtest.h>

#include "tests/core/wire/consistent.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire::round_header_test {
namespace {

using Raw = std::array<std::byte, kRoundHeaderBytes>;

Raw example() {
  Raw out{};
  write_round_header(out, example_round_header());
  return out;
}

Raw with(Raw bytes, std::size_t at, int value) {
  bytes.at(at) = static_cast<std::byte>(value);
  return bytes;
}

TEST(RoundHeader, IsTheDocumentedExample) {
  const Bytes packet = from_hex(kDataExample);
  const ByteView message = ByteView(packet).subspan(kHeaderBytes + kFragmentHeaderBytes);
  EXPECT_TRUE(std::ranges::equal(example(), message.first(kRoundHeaderBytes)));
  EXPECT_EQ(parse_round_header(message), example_round_header());
}

TEST(RoundHeader, TimesAreRoundedUpToMicroseconds) {
  using namespace std::chrono_literals;
  EXPECT_EQ(to_us(-1s), 0U);
  EXPECT_EQ(to_us(0ns), 0U);
  EXPECT_EQ(to_us(1ns), 1U);
  EXPECT_EQ(to_us(1us), 1U);
  EXPECT_EQ(to_us(1'001ns), 2U);
  EXPECT_EQ(to_us(72min), UINT32_MAX);
}

TEST(RoundHeader, EveryTruncationIsRefused) {
  const Raw bytes = example();
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    EXPECT_FALSE(parse_round_header(ByteView(bytes).first(n))) << n;
  }
}

TEST(RoundHeader, EveryChangeOfOneByteIsRefusedOrValid) {
  for (std::size_t at = 0; at < kRoundHeaderBytes; ++at) {
    for (int value = 0; value < 256; ++value) {
      EXPECT_TRUE(refused_or_consistent_message(with(example(), at, value)))
          << at << " := " << value;
    }
  }
}

// Exactly the values from `first` to `last` are valid at this offset of the example.
struct Range {
  const char* name;
  std::size_t at;
  int first;
  int last;
};

TEST(RoundHeader, FieldsKeepTheirRanges) {
  for (const Range& r : {
           Range{"version", 0, 3, 3},
           Range{"flags", 1, 0, 1},
           Range{"class", 2, 0, 1},
           Range{"pipeline", 3, 0, 255},
           Range{"stages", 5, 1, 16},
           Range{"variant", 8, 0, 7},
           Range{"best_planned", 9, 0, 1},
           Range{"origin", 16, 0, 255},
           Range{"policy", 24, 0, 255},
           Range{"period", 32, 0, 255},
           Range{"t0", 40, 0, 255},
           Range{"alpha", 48, 0, 255},
           Range{"guard", 56, 0, 1},
           Range{"level_used", 57, 0, 255},
           Range{"local_quality", 59, 0, 255},
           Range{"miss_price", 60, 0, 255},
           Range{"excess", 62, 0, 255},
           Range{"computed", 64, 0, 255},
           Range{"e2e", 66, 0, 255},
           Range{"e2e, last", 97, 0, 255},
       }) {
    for (int value = 0; value < 256; ++value) {
      EXPECT_EQ(parse_round_header(with(example(), r.at, value)).has_value(),
                value >= r.first && value <= r.last)
          << r.name << " := " << value;
    }
  }
}

TEST(RoundHeader, TheStageIsACommunicationOfThePipeline) {
  for (int stage = 0; stage < 256; ++stage) {
    EXPECT_EQ(parse_round_header(with(example(), 4, stage)).has_value(), stage == 1 || stage == 3)
        << stage;
  }
  EXPECT_FALSE(parse_round_header(with(example(), 7, 0b100)));
}

TEST(RoundHeader, OriginAndDeadlineAreNotZero) {
  Raw bytes = example();
  std::fill_n(bytes.begin() + 16, 4, std::byte{0});
  EXPECT_FALSE(parse_round_header(bytes));
  bytes = example();
  std::fill_n(bytes.begin() + 28, 4, std::byte{0});
  EXPECT_FALSE(parse_round_header(bytes));
}

TEST(RoundHeader, TheVariantUsedIsAVariantOrNone) {
  for (int value = 0; value < 256; ++value) {
    EXPECT_EQ(parse_round_header(with(example(), 58, value)).has_value(), value < 8 || value == 255)
        << value;
  }
}

TEST(RoundHeader, StepsAreSharesOfTheDeadline) {
  RoundHeader h;
  h.deadline_us = 130'000;
  EXPECT_EQ(h.to_steps(std::chrono::milliseconds(130), 0, UINT16_MAX), kDeadlineSteps);
  EXPECT_EQ(h.from_steps(kDeadlineSteps / 2), std::chrono::milliseconds(65));
  EXPECT_EQ(h.to_steps(Duration::max(), 1, kE2eNever), kE2eNever);
  EXPECT_EQ(h.to_steps(Duration::min(), INT16_MIN, INT16_MAX), INT16_MIN);
  h.deadline_us = UINT32_MAX;
  EXPECT_EQ(h.to_steps(h.from_steps(UINT16_MAX), 0, UINT16_MAX), UINT16_MAX);
  EXPECT_EQ(h.to_steps(h.from_steps(INT16_MIN), INT16_MIN, INT16_MAX), INT16_MIN);
}

TEST(RoundHeader, XIsAtLeastMinusOne) {
  RoundHeader h = example_round_header();
  for (const int x : {-1000, 0, 1000, INT16_MAX}) {
    h.x_permille = static_cast<std::int16_t>(x);
    Raw bytes{};
    write_round_header(bytes, h);
    EXPECT_EQ(parse_round_header(bytes), h) << x;
  }
  Raw below = example();  // -1001 = 0xfc17
  below[10] = std::byte{0xfc};
  below[11] = std::byte{0x17};
  EXPECT_FALSE(parse_round_header(below));
}

TEST(RoundHeader, NoPairOfTheIndicatorIsThree) {
  Raw bytes = example();
  std::fill_n(bytes.begin() + 36, 4, std::byte{0});
  for (std::size_t at = 36; at < 40; ++at) {
    for (int pair = 0; pair < 4; ++pair) {
      EXPECT_FALSE(parse_round_header(with(bytes, at, 3 << (2 * pair))));
      EXPECT_TRUE(parse_round_header(with(bytes, at, 2 << (2 * pair))));
    }
  }
}

TEST(RoundHeader, TheIndicatorBeginsWithTheRoundBefore) {
  RoundHeader h = example_round_header();
  h.indicator = {};
  h.indicator.front() = RoundState::kOnTime;
  h.indicator.back() = RoundState::kMissed;
  Raw bytes{};
  write_round_header(bytes, h);
  EXPECT_EQ(bytes[39], std::byte{0x01});
  EXPECT_EQ(bytes[36], std::byte{0x80});
}

TEST(PolicyId, IsThe32BitFnv1aOfTheName) {
  EXPECT_EQ(policy_id(""), 0x811c9dc5U);
  EXPECT_EQ(policy_id("a"), 0xe40c292cU);
  EXPECT_EQ(policy_id("foobar"), 0xbf9cf968U);
}

}  // namespace
}  // namespace interneuron::wire::round_header_test
