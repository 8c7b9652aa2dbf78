#include "core/base/flat_map.h"

#include <gtest/gtest.h>

#include <string>

namespace interneuron::flat_map_test {
namespace {

using Map = FlatMap<int, std::string>;

TEST(FlatMap, KeepsKeysInOrderWhateverTheOrderOfAdding) {
  Map map;
  for (const int key : {5, 1, 3, 4, 2}) EXPECT_TRUE(map.try_emplace(key).second);
  std::vector<int> keys;
  for (const auto& [key, value] : map) keys.push_back(key);
  EXPECT_EQ(keys, (std::vector<int>{1, 2, 3, 4, 5}));
}

TEST(FlatMap, AddsAKeyOnce) {
  Map map;
  map.try_emplace(1).first->second = "one";
  const auto [it, fresh] = map.try_emplace(1);
  EXPECT_FALSE(fresh);
  EXPECT_EQ(it->second, "one");
  EXPECT_EQ(map.size(), 1U);
}

TEST(FlatMap, FindsWhatIsThereAndNothingElse) {
  Map map;
  map.try_emplace(1).first->second = "one";
  map.try_emplace(3).first->second = "three";
  const Map& same = map;
  EXPECT_EQ(same.at(3), "three");
  EXPECT_EQ(same.find(2), same.end());
  EXPECT_TRUE(map.contains(1));
  EXPECT_FALSE(map.contains(2));
}

TEST(FlatMap, LosesWhatIsErased) {
  Map map;
  for (const int key : {1, 2, 3}) map.try_emplace(key).first->second = std::to_string(key);
  map.erase(map.find(2));
  EXPECT_FALSE(map.contains(2));
  EXPECT_EQ(map.at(1), "1");
  EXPECT_EQ(map.at(3), "3");
  map.clear();
  EXPECT_TRUE(map.empty());
}

}  // namespace
}  // namespace interneuron::flat_map_test
