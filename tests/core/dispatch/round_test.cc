#include "core/dispatch/round.h"

#include <gtest/gtest.h>

#include "tests/core/wire/examples.h"

namespace interneuron::round_test {
namespace {

using dispatch::header_of;
using dispatch::round_of;

TEST(Round, TellsTheNextNodeWhatItWasTold) {
  const wire::RoundHeader header = wire::example_round_header();
  EXPECT_EQ(header_of(round_of(header)), header);
}

// A node that passes a time on must not move it, whatever its origin's deadline: of 33 µs on.
TEST(Round, PassesEveryTimeOnUnchanged) {
  wire::RoundHeader header = wire::example_round_header();
  for (const std::uint32_t deadline_us : {33U, 1'000U, 130'000U, 3'600'000'000U}) {
    header.deadline_us = deadline_us;
    for (int steps = 0; steps <= UINT16_MAX; ++steps) {
      header.computed = header.e2e[4] = static_cast<std::uint16_t>(steps);
      header.excess = static_cast<std::int16_t>(steps + INT16_MIN);
      ASSERT_EQ(header_of(round_of(header)), header) << deadline_us << " µs, " << steps;
    }
  }
}

TEST(Round, PassesEveryShareOnUnchanged) {
  wire::RoundHeader header = wire::example_round_header();
  for (int value = 0; value <= UINT16_MAX; ++value) {
    header.miss_price = static_cast<std::uint16_t>(value);
    header.local_quality = header.needs[3] = static_cast<std::uint8_t>(value);
    ASSERT_EQ(header_of(round_of(header)), header) << value;
  }
}

}  // namespace
}  // namespace interneuron::round_test
