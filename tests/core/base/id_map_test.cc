#include "core/base/id_tables.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "interneuron/units.h"

namespace interneuron::id_map_test {
namespace {

TEST(IdMap, IsEmptyAtFirstAndWhenCleared) {
  IdMap<MessageId> map;
  EXPECT_FALSE(map.find(MessageId{0}));
  map.erase(MessageId{0});
  map.insert(MessageId{0}, 7);
  EXPECT_EQ(map.find(MessageId{0}), 7U);
  map.clear();
  EXPECT_FALSE(map.find(MessageId{0}));
  EXPECT_EQ(map.size(), 0U);
}

// Identifiers of few bits that are far apart, as an attacker might choose them, and near ones.
RC_GTEST_PROP(IdMap, DoesWhatAMapDoes, ()) {
  IdMap<MessageId> map;
  std::map<std::uint32_t, std::uint32_t> model;
  const auto shift = *rc::gen::element(0U, 4U, 20U, 24U);
  const int steps = *rc::gen::inRange(0, 400);
  for (int i = 0; i < steps; ++i) {
    const std::uint32_t id = *rc::gen::inRange(0U, 64U) << shift;
    if (model.contains(id)) {
      map.erase(MessageId{id});
      model.erase(id);
    } else {
      map.insert(MessageId{id}, static_cast<std::uint32_t>(i));
      model[id] = static_cast<std::uint32_t>(i);
    }
    RC_ASSERT(map.size() == model.size());
    RC_ASSERT(map.find(MessageId{id}).has_value() == model.contains(id));
    for (const auto& entry : model) RC_ASSERT(map.find(MessageId{entry.first}) == entry.second);
  }
}

}  // namespace
}  // namespace interneuron::id_map_test
