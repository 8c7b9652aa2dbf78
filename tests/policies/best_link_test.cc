#include "tests/policies/support.h"

namespace interneuron::policy_test::best_link_test {
namespace {

TEST(BestLink, SendsOneVariantOverTheFastestLinkThatCanCarryIt) {
  const std::vector<std::size_t> images(kRawAndSampled.begin(), kRawAndSampled.end());
  const std::vector<std::size_t> three{512 * 1024, 256 * 1024, 64 * 1024};
  check("best_link",
        {
            {"the fastest",
             images,
             make_links({{1, 60, 100}, {2, 20, 100}}),
             false,
             {send(0, 2)},
             false},
            {"the fastest that can carry it",
             images,
             make_links({{1, 60, 50}, {2, 20, 30}}),
             false,
             {send(0, 1)},
             false},
            {"a large message: the link of more rate, though of more delay",
             {512 * 1024},
             make_links({{1, 30, 50}, {2, 40, 60}}),
             false,
             {send(0, 2)},
             false},
            {"degraded: the smallest, so another link",
             images,
             make_links({{1, 60, 50}, {2, 20, 30}}),
             true,
             {send(1, 2)},
             false},
            {"degraded: the smallest of three",
             three,
             make_links({{1, 60, 50}}),
             true,
             {send(2, 1)},
             false},
            {"degraded without a smaller variant",
             {512 * 1024},
             make_links({{1, 60, 50}, {2, 70, 50}}),
             true,
             {send(0, 1)},
             false},
            {"no link can: the fastest, reported",
             images,
             make_links({{1, 60, 40}, {2, 20, 30}}),
             false,
             {send(0, 2)},
             true},
            {"degraded, no link can",
             images,
             make_links({{1, 60, 9}, {2, 20, 8}}),
             true,
             {send(1, 2)},
             true},
            {"not measured: meets the floor, comes last",
             images,
             make_links({{1, 0, 0}, {2, 90, 50}}),
             false,
             {send(0, 2)},
             false},
            {"not measured, and nothing else can",
             images,
             make_links({{1, 0, 0}, {2, 90, 30}}),
             false,
             {send(0, 1)},
             false},
            {"down", images, make_links({{1, 60, 50}}, {2}), false, {send(0, 1)}, false},
            {"all down", images, make_links({}, {1, 2}), false, {}, false},
            {"no links", images, {}, true, {}, false},
        });
}

TEST(BestLink, DeliversAtOnce) {
  const PolicySet policies = builtin_policies();
  const Policy& policy = *find_policy(policies, "best_link");
  EXPECT_EQ(policy.merge({.variant = 0}), Merge::kDeliver);
  EXPECT_EQ(policy.merge({.variant = 2, .best_planned = 1}), Merge::kDeliver);
  EXPECT_EQ(policy.merge({.variant = 1, .best_planned = 1, .degraded = true}), Merge::kDeliver);
}

}  // namespace
}  // namespace interneuron::policy_test::best_link_test
