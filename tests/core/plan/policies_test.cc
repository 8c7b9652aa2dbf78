#include "core/plan/policies.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "core/wire/round_header.h"

namespace interneuron::policies_test {
namespace {

using plan::PolicyRegistry;

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

class Named final : public Policy {
 public:
  explicit Named(std::string_view name) : name_(name) {}
  std::string_view name() const override { return name_; }
  Plan plan(const Offer&, std::span<const LinkState>, const Guidance&) const override { return {}; }
  Merge merge(const Arrival&) const override { return {}; }

 private:
  std::string_view name_;
};

// The hash of both names is 1582148253 (FNV-1a).
TEST(PolicyRegistry, RefusesTwoNamesOfOneNumber) {
  const auto one = std::make_shared<Named>("costarring");
  const auto other = std::make_shared<Named>("liquid");
  EXPECT_EQ(wire::policy_id(one->name()), wire::policy_id(other->name()));
  EXPECT_THROW(PolicyRegistry({one, other}), std::invalid_argument);
  EXPECT_NO_THROW(PolicyRegistry({one, one}));
}

TEST(PolicyRegistry, RefusesNoneAndNull) {
  EXPECT_THROW(PolicyRegistry({}), std::invalid_argument);
  EXPECT_THROW(PolicyRegistry({nullptr}), std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::policies_test
