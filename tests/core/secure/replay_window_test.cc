// Each number once: the cases of WireGuard's selftest/counter.c (Linux), and any order against a
// set.
#include "core/secure/session.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

namespace interneuron::crypto::replay_window_test {
namespace {

bool take(ReplayWindow& window, std::uint64_t number) {
  if (!window.is_new(number)) return false;
  window.take(number);
  return true;
}

constexpr std::uint64_t kLimit = ReplayWindow::kReach + 1;

TEST(ReplayWindow, TakesEachNumberOnce) {
  ReplayWindow w;
  const std::vector<std::pair<std::uint64_t, bool>> rows{
      {0, true},
      {1, true},
      {1, false},
      {9, true},
      {8, true},
      {7, true},
      {7, false},
      {kLimit, true},
      {kLimit - 1, true},
      {kLimit - 1, false},
      {kLimit - 2, true},
      {2, true},
      {2, false},
      {kLimit + 16, true},
      {3, false},
      {kLimit + 16, false},
      {kLimit * 4, true},
      {kLimit * 4 - (kLimit - 1), true},
      {10, false},
      {kLimit * 4 - kLimit, false},
      {kLimit * 4 - (kLimit + 1), false},
      {kLimit * 4 - (kLimit - 2), true},
      {kLimit * 4 + 1 - kLimit, false},
      {0, false},
      {UINT64_MAX - 1, true},
      {UINT64_MAX, true},
      {UINT64_MAX - 1, false},
      {UINT64_MAX, false},
      {UINT64_MAX - 2, true},
      {UINT64_MAX - ReplayWindow::kReach, true},
      {UINT64_MAX - ReplayWindow::kReach - 1, false},
      {0, false},
  };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(take(w, rows[i].first), rows[i].second) << "row " << i;
  }
}

TEST(ReplayWindow, UpAndDownAndAcrossItsLength) {
  for (const std::uint64_t first : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{63}}) {
    ReplayWindow up;
    for (std::uint64_t i = first; i < first + 3 * kLimit; ++i) EXPECT_TRUE(take(up, i));
    for (std::uint64_t i = first; i < first + 3 * kLimit; ++i) EXPECT_FALSE(take(up, i));
    ReplayWindow down;
    EXPECT_TRUE(take(down, first + kLimit));
    for (std::uint64_t i = first + kLimit; i-- > first + 1;) EXPECT_TRUE(take(down, i)) << i;
    EXPECT_FALSE(take(down, first));
  }
}

RC_GTEST_PROP(ReplayWindow, IsASet, ()) {
  ReplayWindow w;
  std::set<std::uint64_t> taken;
  std::uint64_t largest = 0;
  const auto steps = *rc::gen::container<std::vector<std::pair<bool, std::uint32_t>>>(
      rc::gen::pair(rc::gen::arbitrary<bool>(), rc::gen::inRange<std::uint32_t>(0, 20'000)));
  for (const auto& [ahead, by] : steps) {
    const std::uint64_t number =
        ahead ? largest + by : largest - std::min<std::uint64_t>(by, largest);
    const bool expected = !taken.contains(number) && (taken.empty() || largest < number + kLimit);
    RC_ASSERT(take(w, number) == expected);
    if (!expected) continue;
    taken.insert(number);
    largest = std::max(largest, number);
  }
}

}  // namespace
}  // namespace interneuron::crypto::replay_window_test
