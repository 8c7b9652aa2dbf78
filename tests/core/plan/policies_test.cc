#include "core/plan/policies.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "core/wire/round_header.h"

namespace interneuron::policies_test {
namespace {

TEST(PolicyRegistry, FindsEachPolicyByItsNameAndByTheIdOfHeaders) {
  const PolicySet all = builtin_policies();
  const PolicyRegistry registry(all);
  for (const auto& policy : all) {
    EXPECT_EQ(registry.find(policy->name()), policy.get());
    EXPECT_EQ(registry.find(wire::policy_id(policy->name())), policy.get());
  }
}

TEST(PolicyRegistry, WhatAPeerNamesMayBeUnknown) {
  const PolicySet all = builtin_policies();
  const PolicyRegistry registry(all);
  EXPECT_EQ(registry.find("downsampling"), nullptr);
  EXPECT_EQ(registry.find(0U), nullptr);
  EXPECT_EQ(&registry.find_or_first(0U), all.front().get());
  EXPECT_EQ(registry.find_or_first(wire::policy_id("split")).name(), "split");
}

TEST(PolicyRegistry, NamesThemInTheOrderOfRegistration) {
  const PolicySet all = builtin_policies();
  EXPECT_EQ(PolicyRegistry({all[1], all[0]}).names(), "duplicate, best_link");
}

TEST(PolicyRegistry, RefusesNoneAndNull) {
  EXPECT_THROW(PolicyRegistry({}), std::invalid_argument);
  EXPECT_THROW(PolicyRegistry({nullptr}), std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::policies_test
