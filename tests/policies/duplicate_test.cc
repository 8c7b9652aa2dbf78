#include "tests/policies/support.h"

namespace interneuron::policy_test::duplicate_test {
namespace {

TEST(Duplicate, SendsOneVariantOverEveryLinkThatCanCarryIt) {
  const std::vector<std::size_t> images(kRawAndSampled.begin(), kRawAndSampled.end());
  check("duplicate",
        {
            {"all, the fastest first",
             images,
             make_links({{1, 60, 50}, {2, 20, 100}, {3, 40, 60}}),
             false,
             {send(0, 2), send(0, 3), send(0, 1)},
             false},
            {"only those that can",
             images,
             make_links({{1, 60, 50}, {2, 20, 30}}),
             false,
             {send(0, 1)},
             false},
            {"degraded: the smallest",
             images,
             make_links({{1, 60, 50}, {2, 20, 30}}),
             true,
             {send(1, 2), send(1, 1)},
             false},
            {"none can: all, reported",
             images,
             make_links({{1, 60, 40}, {2, 20, 30}}),
             false,
             {send(0, 2), send(0, 1)},
             true},
            {"not measured counts",
             images,
             make_links({{1, 0, 0}, {2, 20, 50}}),
             false,
             {send(0, 2), send(0, 1)},
             false},
            {"down", images, make_links({{1, 60, 50}}, {2}), false, {send(0, 1)}, false},
            {"all down", images, make_links({}, {1, 2}), true, {}, false},
        });
}

TEST(Duplicate, DeliversTheFirstCopyAtOnce) {
  const PolicySet policies = builtin_policies();
  const Policy& policy = *find_policy(policies, "duplicate");
  EXPECT_EQ(policy.merge({.variant = 0}), Merge::kDeliver);
  EXPECT_EQ(policy.merge({.variant = 1, .best_planned = 1, .degraded = true}), Merge::kDeliver);
}

}  // namespace
}  // namespace interneuron::policy_test::duplicate_test
