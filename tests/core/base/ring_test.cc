#include "core/base/ring.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <deque>
#include <utility>

namespace interneuron::ring_test {
namespace {

TEST(Ring, IsEmptyAtFirst) {
  const Ring<int> ring;
  EXPECT_TRUE(ring.empty());
  EXPECT_EQ(ring.size(), 0U);
}

TEST(Ring, FirstInFirstOut) {
  Ring<int> ring;
  for (const int value : {1, 2, 3}) ring.push_back(value);
  EXPECT_EQ(ring.front(), 1);
  EXPECT_EQ(ring.back(), 3);
  ring.pop_front();
  EXPECT_EQ(ring.front(), 2);
  EXPECT_EQ(ring[1], 3);
}

TEST(Ring, KeepsTheOrderWhenItGrowsInTheMiddleOfALap) {
  Ring<int> ring;
  for (int i = 0; i < 16; ++i) ring.push_back(i);
  for (int i = 0; i < 10; ++i) ring.pop_front();
  for (int i = 16; i < 40; ++i) ring.push_back(i);
  ASSERT_EQ(ring.size(), 30U);
  for (std::size_t i = 0; i < ring.size(); ++i) EXPECT_EQ(ring[i], static_cast<int>(i) + 10);
}

TEST(Ring, ClearedItIsAsNew) {
  Ring<int> ring;
  for (int i = 0; i < 20; ++i) ring.push_back(i);
  ring.clear();
  EXPECT_TRUE(ring.empty());
  ring.push_back(7);
  EXPECT_EQ(ring.front(), 7);
  EXPECT_EQ(ring.back(), 7);
}

RC_GTEST_PROP(Ring, DoesWhatADequeDoes, (std::vector<std::pair<bool, int>> steps)) {
  Ring<int> ring;
  std::deque<int> model;
  for (const auto& [pops, value] : steps) {
    if (pops && !model.empty()) {
      ring.pop_front();
      model.pop_front();
    } else {
      ring.push_back(value);
      model.push_back(value);
    }
    RC_ASSERT(ring.size() == model.size());
    for (std::size_t i = 0; i < model.size(); ++i) RC_ASSERT(ring[i] == model[i]);
    if (model.empty()) continue;
    RC_ASSERT(ring.front() == model.front());
    RC_ASSERT(ring.back() == model.back());
  }
}

}  // namespace
}  // namespace interneuron::ring_test
