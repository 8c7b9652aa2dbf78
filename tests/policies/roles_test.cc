// What helps a message: the repair symbols and shadows that policies plan beside what sets out at
// once. The tests of each policy look at what sets out.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <string_view>
#include <vector>

#include "interneuron/policy.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::roles_test {
namespace {

using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

// Raw and sampled fit link 1, sampled alone fits link 2, which has less delay.
std::vector<LinkState> two_links() { return make_links({{1, 60, 60}, {2, 20, 30}}); }

std::vector<LinkState> with(std::uint8_t id, const std::function<void(LinkTraits&)>& change) {
  auto links = two_links();
  change(std::ranges::find(links, LinkId{id}, &LinkState::id)->traits);
  link::score(links);
  return links;
}

Assignments with_role(SendRole role, std::string_view policy_name,
                      const std::vector<LinkState>& links, bool degraded = false) {
  const PolicySet policies = builtin_policies();
  const Policy* policy = find_policy(policies, policy_name);
  const Plan plan = policy->plan({frames_at_10_hz(), kRawAndSampled}, links, {degraded});
  Assignments out;
  for (const Assignment& a : plan.sends) {
    if (a.role == role) out.push_back(a);
  }
  return out;
}

Assignment with_role(Assignment a, SendRole role) {
  a.role = role;
  return a;
}

Assignment parity(int variant, int link) {
  return with_role(send(variant, link), SendRole::kParity);
}
Assignment shadow(int variant, int link) {
  return with_role(send(variant, link), SendRole::kShadow);
}

TEST(Roles, SymbolsOfTheBestVariantMayGoOverEveryLink) {
  for (const char* policy : {"coded", "stripe", "down_sampling", "joint"}) {
    SCOPED_TRACE(policy);
    EXPECT_THAT(with_role(SendRole::kParity, policy, two_links()),
                UnorderedElementsAre(parity(0, 1), parity(0, 2)));
    EXPECT_THAT(with_role(SendRole::kParity, policy, two_links(), true),
                UnorderedElementsAre(parity(1, 1), parity(1, 2)));
  }
}

TEST(Roles, SymbolsCostNothingOverALinkThatIsPaidForUnlessItCarriesTheMessage) {
  const auto metered = with(2, [](LinkTraits& t) { t.metered = true; });
  EXPECT_THAT(with_role(SendRole::kParity, "coded", metered), UnorderedElementsAre(parity(0, 1)));
  const auto one_link = make_links({{2, 20, 60}});
  EXPECT_THAT(with_role(SendRole::kParity, "coded", one_link), UnorderedElementsAre(parity(0, 2)));
}

TEST(Roles, OtherPoliciesSendNoSymbols) {
  for (const char* policy : {"best_link", "duplicate", "split", "shadow", "failover", "min_rtt",
                             "lowest_latency", "reinject"}) {
    SCOPED_TRACE(policy);
    EXPECT_THAT(with_role(SendRole::kParity, policy, two_links()), IsEmpty());
  }
}

TEST(Roles, WhatIsMissingOrASmallerVariantStandsByOverTheOtherLink) {
  for (const char* policy : {"coded", "shadow"}) {
    SCOPED_TRACE(policy);
    EXPECT_THAT(with_role(SendRole::kShadow, policy, two_links()),
                UnorderedElementsAre(shadow(0, 2), shadow(1, 2)));
    // Sampled sets out over link 2, and there is nothing smaller.
    EXPECT_THAT(with_role(SendRole::kShadow, policy, two_links(), true),
                UnorderedElementsAre(shadow(1, 1)));
  }
}

TEST(Roles, SharesStandByOverEveryLink) {
  EXPECT_THAT(with_role(SendRole::kShadow, "stripe", two_links()),
              UnorderedElementsAre(shadow(0, 1), shadow(0, 2), shadow(1, 1), shadow(1, 2)));
}

TEST(Roles, RawStandsByWhereTheSampledCopyWent) {
  EXPECT_THAT(with_role(SendRole::kShadow, "down_sampling", two_links()),
              UnorderedElementsAre(shadow(0, 2)));
  EXPECT_THAT(with_role(SendRole::kShadow, "down_sampling", two_links(), true), IsEmpty());
}

TEST(Roles, FailoverHasNoSmallerVariantInReserve) {
  const auto first = with(1, [](LinkTraits& t) { t.priority = -1; });
  EXPECT_THAT(with_role(SendRole::kWhole, "failover", first), UnorderedElementsAre(send(0, 1)));
  EXPECT_THAT(with_role(SendRole::kShadow, "failover", first), UnorderedElementsAre(shadow(0, 2)));
}

TEST(Roles, NothingStandsByOverALinkThatIsPaidFor) {
  const auto metered = with(2, [](LinkTraits& t) { t.metered = true; });
  for (const char* policy : {"coded", "shadow"}) {
    SCOPED_TRACE(policy);
    EXPECT_THAT(with_role(SendRole::kShadow, policy, metered), IsEmpty());
  }
  EXPECT_THAT(with_role(SendRole::kShare, "stripe", metered),
              UnorderedElementsAre(with_role(send(0, 1), SendRole::kShare)));
}

}  // namespace
}  // namespace interneuron::policy_test::roles_test
