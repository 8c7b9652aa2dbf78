#include <stdexcept>

#include "core/plan/plan_message.h"
#include "tests/policies/any.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::secure_test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const PolicySet& policies() {
  static const PolicySet all = builtin_policies();
  return all;
}

std::vector<LinkState> links_trusting(std::uint8_t trusted) {
  auto links = make_links({{1, 60, 50}, {2, 20, 100}});
  for (LinkState& link : links) link.traits.trusted = link.id.value == trusted;
  link::score(links);
  return links;
}

TEST(Secure, UsesTrustedNetworksAlone) {
  const Policy& policy = *find_policy(policies(), "secure");
  const Offer offer{frames_at_10_hz(), kRawAndSampled};
  EXPECT_THAT(setting_out(policy.plan(offer, links_trusting(1), {})), ElementsAre(send(0, 1)));
  EXPECT_THAT(setting_out(policy.plan(offer, links_trusting(2), {})), ElementsAre(send(0, 2)));
}

TEST(Secure, RefusesAndSaysWhy) {
  const Policy& policy = *find_policy(policies(), "secure");
  const Plan plan =
      plan_message(policy, {frames_at_10_hz(), kRawAndSampled}, links_trusting(0), {});
  EXPECT_THAT(plan.sends, IsEmpty());
  EXPECT_EQ(plan.refused, kInsecure);
}

TEST(Secure, SmallResultsAreNoException) {
  const Policy& policy = *find_policy(policies(), "secure");
  QoS qos = frames_at_10_hz();
  qos.message_class = MessageClass::kResult;
  const std::size_t small[] = {2000};
  EXPECT_THAT(plan_message(policy, {qos, small}, links_trusting(2), {}).sends,
              ElementsAre(send(0, 2)));
  const Plan refusal = plan_message(policy, {qos, small}, links_trusting(0), {});
  EXPECT_THAT(refusal.sends, IsEmpty());
  EXPECT_EQ(refusal.refused, kInsecure);
}

TEST(Secure, WrapsAnyPolicyUnderAnyName) {
  const auto both = secure(policies()[1], 0.5, "secure_duplicate");
  EXPECT_EQ(both->name(), "secure_duplicate");
  EXPECT_THROW(secure(nullptr, 0.5, "secure"), std::invalid_argument);
  EXPECT_THROW(secure(both, 0, "secure"), std::invalid_argument);
  EXPECT_THROW(secure(both, 1.1, "secure"), std::invalid_argument);
}

RC_GTEST_PROP(SecureProperty, NothingLeavesOverALinkBelowTheFloor, ()) {
  const auto links = any_links();
  const AnyMessage m;
  const double floor = *rc::gen::element(0.1, 0.5, 0.6, 1.0);
  for (const auto& inner : builtin_policies()) {
    const auto policy = secure(inner, floor, "s");
    const Plan plan = plan_message(*policy, m.offer(), links, m.guidance);
    for (const Assignment& send : plan.sends) {
      RC_ASSERT(link_of(links, send.link).nature.security >= floor);
    }
  }
}

RC_GTEST_PROP(SecureProperty, PlansAsTheInnerPolicyWouldOverTheOthersAlone, ()) {
  const auto links = any_links();
  const AnyMessage m;
  std::vector<LinkState> trusted = links;
  std::erase_if(trusted, [](const LinkState& link) { return link.nature.security < 0.5; });
  if (std::ranges::none_of(trusted, &LinkState::up)) return;
  for (const auto& inner : builtin_policies()) {
    const Plan plan = secure(inner, 0.5, "s")->plan(m.offer(), links, m.guidance);
    RC_ASSERT(plan.sends == inner->plan(m.offer(), trusted, m.guidance).sends);
  }
}

}  // namespace
}  // namespace interneuron::policy_test::secure_test
