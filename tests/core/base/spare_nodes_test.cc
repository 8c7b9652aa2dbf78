#include "core/base/spare_nodes.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

namespace interneuron::spare_nodes_test {
namespace {

TEST(SpareNodes, AMapIsAsIfItsNodesWereNew) {
  std::map<int, std::string> map;
  SpareNodes<std::map<int, std::string>> spare;
  spare.insert(map, 1, "one");
  spare.insert(map, 2, "two");
  spare.erase(map, 1);
  spare.erase(map, 7);
  EXPECT_EQ(map, (std::map<int, std::string>{{2, "two"}}));
  spare.insert(map, 3, "three");
  EXPECT_EQ(map, (std::map<int, std::string>{{2, "two"}, {3, "three"}}));
}

TEST(SpareNodes, TheNodeOfWhatWasErasedIsUsedAgain) {
  std::set<int> set;
  SpareNodes<std::set<int>> spare;
  spare.insert(set, 1);
  const int* before = &*set.begin();
  spare.erase(set, set.begin());
  EXPECT_TRUE(set.empty());
  spare.insert(set, 2);
  EXPECT_EQ(*set.begin(), 2);
  EXPECT_EQ(&*set.begin(), before);
}

}  // namespace
}  // namespace interneuron::spare_nodes_test
