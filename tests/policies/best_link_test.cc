#include "tests/policies/support.h"

namespace interneuron::policy_test::best_link_test {
namespace {

TEST(BestLink, SendsOneVariantOverTheFastestLinkThatCanCarryIt) {
  const std::vector<std::size_t> images(kRawAndSampled.begin(), kRawAndSampled.end());
  const std::vector<std::size_t> three{512 * 1024, 256 * 1024, 64 * 1024};
  const std::vector<std::size_t> large{512 * 1024};
  // Of the links each has its id, round trip in ms and rate in Mbit/s.
  const auto both_can = make_links({{1, 60, 100}, {2, 20, 100}});
  const auto first_can = make_links({{1, 60, 50}, {2, 20, 30}});
  const auto wider = make_links({{1, 30, 50}, {2, 40, 60}});
  const auto one_can = make_links({{1, 60, 50}});
  const auto first_nearer = make_links({{1, 60, 50}, {2, 70, 50}});
  const auto raw_nowhere = make_links({{1, 60, 40}, {2, 20, 30}});
  const auto none_can = make_links({{1, 60, 9}, {2, 20, 8}});
  const auto new_wide = make_links({{1, 0, 0}, {2, 90, 50}});
  const auto new_slow = make_links({{1, 0, 0}, {2, 90, 30}});
  const auto one_down = make_links({{1, 60, 50}}, {2});
  const auto all_down = make_links({}, {1, 2});
  const std::vector<Case> cases{
      {"the fastest", images, both_can, false, {send(0, 2)}, false},
      {"the fastest that can carry it", images, first_can, false, {send(0, 1)}, false},
      {"a large message: more rate beats less delay", large, wider, false, {send(0, 2)}, false},
      {"degraded: the smallest, so another link", images, first_can, true, {send(1, 2)}, false},
      {"degraded: the smallest of three", three, one_can, true, {send(2, 1)}, false},
      {"degraded without a smaller variant", large, first_nearer, true, {send(0, 1)}, false},
      {"no link can: the fastest, reported", images, raw_nowhere, false, {send(0, 2)}, true},
      {"degraded, no link can", images, none_can, true, {send(1, 2)}, true},
      {"not measured: meets the floor, comes last", images, new_wide, false, {send(0, 2)}, false},
      {"not measured, and nothing else can", images, new_slow, false, {send(0, 1)}, false},
      {"down", images, one_down, false, {send(0, 1)}, false},
      {"all down", images, all_down, false, {}, false},
      {"no links", images, {}, true, {}, false},
  };
  check("best_link", cases);
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
