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

constexpr std::pair<const char*, std::string_view> kBoth[] = {{"secure", kInsecure},
                                                              {"trusted_only", kUntrusted}};

TEST(Secure, InTheClearUsesTrustedNetworksAlone) {
  const Offer offer{frames_at_10_hz(), kRawAndSampled};
  for (const auto& [name, refusal] : kBoth) {
    const Policy& policy = *find_policy(policies(), name);
    EXPECT_THAT(setting_out(policy.plan(offer, links_trusting(1), {})), ElementsAre(send(0, 1)));
    EXPECT_THAT(setting_out(policy.plan(offer, links_trusting(2), {})), ElementsAre(send(0, 2)));
  }
}

// A carrier's network, packets encrypted: the default of a vehicle.
TEST(Secure, EncryptedPacketsMayCrossForeignNetworksButNotWithTrustedOnly) {
  auto links = links_trusting(1);
  for (LinkState& link : links) link.encrypted = true;
  link::score(links);
  const Offer offer{frames_at_10_hz(), kRawAndSampled};
  const auto sends_of = [&](const char* name) {
    return setting_out(find_policy(policies(), name)->plan(offer, links, {}));
  };
  EXPECT_EQ(sends_of("secure"), sends_of("down_sampling"));
  EXPECT_THAT(sends_of("trusted_only"), ElementsAre(send(0, 1)));
}

TEST(Secure, RefusesAndSaysWhy) {
  for (const auto& [name, refusal] : kBoth) {
    const Plan plan = plan::plan_message(
        *find_policy(policies(), name), {frames_at_10_hz(), kRawAndSampled}, links_trusting(0), {});
    EXPECT_THAT(plan.sends, IsEmpty());
    EXPECT_EQ(plan.refused, refusal);
  }
}

TEST(Secure, SmallResultsAreNoException) {
  QoS qos = frames_at_10_hz();
  qos.message_class = MessageClass::kResult;
  const std::size_t small[] = {2000};
  for (const auto& [name, refusal] : kBoth) {
    const Policy& policy = *find_policy(policies(), name);
    EXPECT_THAT(plan::plan_message(policy, {qos, small}, links_trusting(2), {}).sends,
                ElementsAre(send(0, 2)));
    const Plan plan = plan::plan_message(policy, {qos, small}, links_trusting(0), {});
    EXPECT_THAT(plan.sends, IsEmpty());
    EXPECT_EQ(plan.refused, refusal);
  }
}

TEST(Secure, WrapsAnyPolicyUnderAnyName) {
  const auto both = secure(policies()[1], 0.5, "secure_duplicate");
  EXPECT_EQ(both->name(), "secure_duplicate");
  EXPECT_THROW(secure(nullptr, 0.5, "secure"), std::invalid_argument);
  EXPECT_THROW(secure(both, 0, "secure"), std::invalid_argument);
  EXPECT_THROW(secure(both, 1.1, "secure"), std::invalid_argument);
  EXPECT_EQ(trusted_only(both, "ours_alone")->name(), "ours_alone");
  EXPECT_THROW(trusted_only(nullptr, "ours_alone"), std::invalid_argument);
}

RC_GTEST_PROP(SecureProperty, NothingLeavesOverALinkBelowTheFloor, ()) {
  const auto links = any_links();
  const AnyMessage m;
  const double floor = *rc::gen::element(0.1, 0.5, 0.6, 1.0);
  for (const auto& inner : builtin_policies()) {
    const auto policy = secure(inner, floor, "s");
    const Plan plan = plan::plan_message(*policy, m.offer(), links, m.guidance);
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
