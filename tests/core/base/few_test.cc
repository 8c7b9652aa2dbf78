#include "interneuron/few.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace interneuron::few_test {
namespace {

using Four = Few<int, 4>;

std::vector<int> values(const Four& few) { return {few.begin(), few.end()}; }

TEST(Few, IsEmptyAtFirst) {
  const Four few;
  EXPECT_TRUE(few.empty());
  EXPECT_EQ(few.begin(), few.end());
}

TEST(Few, WhatDoesNotFitIsLeftOut) {
  Four few{1, 2, 3};
  EXPECT_TRUE(few.push_back(4));
  EXPECT_FALSE(few.push_back(5));
  EXPECT_EQ(few, (Four{1, 2, 3, 4}));
  EXPECT_EQ((Four{1, 2, 3, 4, 5, 6}), few);
}

TEST(Few, InsertedInFrontOfAPosition) {
  Four few{1, 3};
  few.insert(1, 2);
  few.insert(3, 4);
  EXPECT_EQ(few, (Four{1, 2, 3, 4}));
}

TEST(Few, WhereThereIsNoRoomTheLastOneGoes) {
  Four few{1, 2, 3, 4};
  few.insert(0, 0);
  EXPECT_EQ(few, (Four{0, 1, 2, 3}));
  few.insert(4, 9);  // behind the last one of all
  EXPECT_EQ(few, (Four{0, 1, 2, 3}));
}

TEST(Few, CopiesAreApart) {
  Four few{1, 2};
  Four copy = few;
  copy[0] = 7;
  EXPECT_EQ(few.front(), 1);
  few = copy;
  few.back() = 8;
  EXPECT_EQ(copy, (Four{7, 2}));
  EXPECT_EQ(few, (Four{7, 8}));
  Four& same = few;
  few = same;
  EXPECT_EQ(few, (Four{7, 8}));
}

TEST(Few, OneIsAnotherThanAShorterOne) { EXPECT_FALSE((Four{1, 2}) == (Four{1, 2, 3})); }

RC_GTEST_PROP(Few, DoesWhatAVectorCutToItsSizeDoes,
              (std::vector<std::pair<std::uint8_t, int>> steps)) {
  Four few;
  std::vector<int> model;
  for (const auto& [where, value] : steps) {
    if (where % 2 == 0) {
      RC_ASSERT(few.push_back(value) == (model.size() < 4));
      model.push_back(value);
    } else {
      const std::size_t at = where % (model.size() + 1);
      few.insert(at, value);
      model.insert(model.begin() + static_cast<std::ptrdiff_t>(at), value);
    }
    model.resize(std::min<std::size_t>(model.size(), 4));
    RC_ASSERT(values(few) == model);
  }
}

}  // namespace
}  // namespace interneuron::few_test
