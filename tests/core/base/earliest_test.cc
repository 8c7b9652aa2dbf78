#include "core/base/earliest.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

#include "interneuron/time.h"

namespace interneuron::earliest_test {
namespace {

using namespace std::chrono_literals;
using MaybeTime = std::optional<TimePoint>;

constexpr TimePoint at(Duration d) { return TimePoint{d}; }

TEST(Earliest, NothingOfNothing) {
  EXPECT_EQ(earliest(MaybeTime{}, std::nullopt), std::nullopt);
  EXPECT_EQ(earliest(MaybeTime{}, std::nullopt, std::nullopt), std::nullopt);
}

TEST(Earliest, AMissingInstantIsPassedOver) {
  EXPECT_EQ(earliest(MaybeTime{}, at(3s)), at(3s));
  EXPECT_EQ(earliest(MaybeTime{at(3s)}, std::nullopt), at(3s));
  EXPECT_EQ(earliest(MaybeTime{}, std::nullopt, at(2s), at(1s)), at(1s));
}

TEST(Earliest, IsKnownAtCompileTime) {
  static_assert(earliest(MaybeTime{at(2s)}, at(1s)) == at(1s));
  static_assert(*earliest(std::optional<Duration>{}, 5ms) == 5ms);
}

RC_GTEST_PROP(Earliest, IsTheSmallestOfThoseThatAreThere, (std::vector<int> values)) {
  MaybeTime next;
  for (const int value : values) {
    next = earliest(next, value % 2 == 0 ? MaybeTime{at(Duration{value})} : std::nullopt);
  }
  MaybeTime expected;
  for (const int value : values) {
    if (value % 2 == 0 && (!expected || at(Duration{value}) < *expected)) {
      expected = at(Duration{value});
    }
  }
  RC_ASSERT(next == expected);
}

}  // namespace
}  // namespace interneuron::earliest_test
