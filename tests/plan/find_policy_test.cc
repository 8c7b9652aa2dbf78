#include "plan/find_policy.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace interneuron {
namespace {

TEST(FindPolicy, FindsEachBuiltInPolicyByItsName) {
  const PolicySet policies = builtin_policies();
  std::set<std::string_view> names;
  for (const auto& policy : policies) {
    names.insert(policy->name());
    EXPECT_EQ(find_policy(policies, policy->name()), policy.get());
  }
  EXPECT_EQ(names, (std::set<std::string_view>{"best_link", "duplicate", "down_sampling"}));
}

TEST(FindPolicy, AnotherNameIsNotFound) {
  const PolicySet policies = builtin_policies();
  for (const char* name : {"", "best", "best_link2", "BEST_LINK", "best_link "}) {
    EXPECT_EQ(find_policy(policies, name), nullptr) << name;
  }
  EXPECT_EQ(find_policy({}, "best_link"), nullptr);
}

TEST(FindPolicy, SkipsEmptyEntries) {
  PolicySet policies = builtin_policies();
  policies.insert(policies.begin(), nullptr);
  EXPECT_EQ(find_policy(policies, "duplicate"), policies[2].get());
}

}  // namespace
}  // namespace interneuron
