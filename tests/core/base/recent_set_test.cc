#include "core/base/id_tables.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>

#include "interneuron/units.h"

namespace interneuron::recent_set_test {
namespace {

TEST(RecentSet, IsEmptyAtFirstAndWhenCleared) {
  RecentSet<MessageId, 64> set;
  EXPECT_FALSE(set.contains(MessageId{0}));
  set.insert(MessageId{0});
  EXPECT_TRUE(set.contains(MessageId{0}));
  set.clear();
  EXPECT_FALSE(set.contains(MessageId{0}));
}

TEST(RecentSet, TheOldestMakesRoom) {
  RecentSet<MessageId, 64> set;
  for (std::uint32_t i = 0; i < 65; ++i) set.insert(MessageId{i});
  EXPECT_FALSE(set.contains(MessageId{0}));
  for (std::uint32_t i = 1; i < 65; ++i) EXPECT_TRUE(set.contains(MessageId{i}));
}

// Identifiers of few bits that are far apart, as an attacker might choose them, and near ones.
RC_GTEST_PROP(RecentSet, DoesWhatADequeDoes, ()) {
  RecentSet<MessageId, 32> set;
  std::deque<std::uint32_t> model;
  const auto shift = *rc::gen::element(0U, 4U, 20U, 24U);
  const int steps = *rc::gen::inRange(0, 400);
  for (int i = 0; i < steps; ++i) {
    const std::uint32_t id = *rc::gen::inRange(0U, 64U) << shift;
    const bool known = std::ranges::find(model, id) != model.end();
    RC_ASSERT(set.contains(MessageId{id}) == known);
    if (known) continue;
    set.insert(MessageId{id});
    model.push_back(id);
    if (model.size() > 32) model.pop_front();
    for (const std::uint32_t kept : model) RC_ASSERT(set.contains(MessageId{kept}));
  }
}

}  // namespace
}  // namespace interneuron::recent_set_test
