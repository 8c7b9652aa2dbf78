#include "core/plan/plan_message.h"

#include <gmock/gmock.h>

#include <array>

namespace interneuron {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Answers what it is told to, however wrong.
class Scripted final : public Policy {
 public:
  explicit Scripted(Plan answer) : answer_(std::move(answer)) {}
  std::string_view name() const override { return "scripted"; }
  Plan plan(const Offer&, std::span<const LinkState>, const Guidance&) const override {
    return answer_;
  }
  Merge merge(const Arrival&) const override { return Merge::kDeliver; }

 private:
  Plan answer_;
};

constexpr LinkId kUp{1};
constexpr LinkId kDown{2};
constexpr LinkId kAlsoUp{3};
constexpr LinkId kUnknown{4};

std::vector<LinkState> three_links() {
  std::vector<LinkState> links(3);
  links[0].id = kUp;
  links[1].id = kDown;
  links[2].id = kAlsoUp;
  links[0].up = links[2].up = true;
  for (LinkState& link : links) link.nature.security = 0.5;  // what the policy `secure` asks for
  return links;
}

Plan plan_with(const Policy& policy, MessageClass message_class,
               std::span<const std::size_t> variant_bytes) {
  const QoS qos{
      .deadline = milliseconds(130), .period = milliseconds(100), .message_class = message_class};
  return plan_message(policy, {qos, variant_bytes}, three_links(), {});
}

constexpr std::array<std::size_t, 2> kTwoVariants{512 * 1024, 128 * 1024};

TEST(PlanMessage, PassesASoundPlanOn) {
  const Scripted policy({.sends = {{1, kAlsoUp}, {0, kUp}}, .under_floor = true});
  const Plan plan = plan_with(policy, MessageClass::kData, kTwoVariants);
  EXPECT_THAT(plan.sends, ElementsAre(Assignment{1, kAlsoUp}, Assignment{0, kUp}));
  EXPECT_TRUE(plan.under_floor);
}

TEST(PlanMessage, DropsWhatCannotBeSent) {
  const Scripted policy({.sends = {{0, kDown},
                                   {0, kUnknown},
                                   {2, kUp},
                                   {255, kUp},
                                   {0, kUp},
                                   {0, kUp},
                                   {1, kUp},
                                   {0, kUp}}});
  const Plan plan = plan_with(policy, MessageClass::kData, kTwoVariants);
  EXPECT_THAT(plan.sends, ElementsAre(Assignment{0, kUp}, Assignment{1, kUp}));
}

TEST(PlanMessage, AnEmptyPlanIsNotUnderAFloor) {
  const Scripted policy({.sends = {{0, kDown}}, .under_floor = true});
  const Plan plan = plan_with(policy, MessageClass::kData, kTwoVariants);
  EXPECT_THAT(plan.sends, IsEmpty());
  EXPECT_FALSE(plan.under_floor);
}

TEST(PlanMessage, SmallResultsGoOverEveryLinkWhicheverPolicyRuns) {
  const Scripted nothing({});
  const std::array<std::size_t, 2> sizes{kSmallResultBytes, 10};
  const auto everywhere = ElementsAre(Assignment{0, kUp}, Assignment{0, kAlsoUp});
  EXPECT_THAT(plan_with(nothing, MessageClass::kResult, sizes).sends, everywhere);
  for (const auto& policy : builtin_policies()) {
    const Plan plan = plan_with(*policy, MessageClass::kResult, sizes);
    EXPECT_THAT(plan.sends, everywhere) << policy->name();
    EXPECT_FALSE(plan.under_floor);
  }
}

// Allows one link, and plans both.
class Choosy final : public Policy {
 public:
  std::string_view name() const override { return "choosy"; }
  Plan plan(const Offer&, std::span<const LinkState>, const Guidance&) const override {
    return {.sends = {{0, kUp}, {0, kAlsoUp}}, .refused = "not refused after all"};
  }
  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
  bool allows(const LinkState& link) const override { return link.id == kAlsoUp; }
};

TEST(PlanMessage, NothingGoesOverALinkThatThePolicyForbids) {
  const std::array<std::size_t, 1> small{kSmallResultBytes};
  for (const MessageClass message_class : {MessageClass::kData, MessageClass::kResult}) {
    const Plan plan = plan_with(Choosy(), message_class, small);
    EXPECT_THAT(plan.sends, ElementsAre(Assignment{0, kAlsoUp}));
    EXPECT_TRUE(plan.refused.empty());
  }
}

TEST(PlanMessage, PassesOnWhyNothingIsSent) {
  const Scripted policy({.sends = {}, .under_floor = true, .refused = "too far"});
  const Plan plan = plan_with(policy, MessageClass::kData, kTwoVariants);
  EXPECT_THAT(plan.sends, IsEmpty());
  EXPECT_FALSE(plan.under_floor);
  EXPECT_EQ(plan.refused, "too far");
}

TEST(PlanMessage, AnEmptyPlanIsADecisionAndAnImpossibleOneIsNot) {
  EXPECT_EQ(plan_with(Scripted({}), MessageClass::kData, kTwoVariants).refused, kNothingPlanned);
  const Scripted impossible({.sends = {{0, kDown}}});
  EXPECT_TRUE(plan_with(impossible, MessageClass::kData, kTwoVariants).refused.empty());
}

TEST(PlanMessage, LargerResultsAndSmallDataAreThePolicysBusiness) {
  const Scripted policy({.sends = {{0, kUp}}});
  const std::array<std::size_t, 1> larger{kSmallResultBytes + 1};
  const std::array<std::size_t, 1> small{1};
  EXPECT_THAT(plan_with(policy, MessageClass::kResult, larger).sends,
              ElementsAre(Assignment{0, kUp}));
  EXPECT_THAT(plan_with(policy, MessageClass::kData, small).sends, ElementsAre(Assignment{0, kUp}));
}

TEST(PlanMessage, NothingIsSentWithoutALinkOrWithoutAVariant) {
  const Scripted policy({.sends = {{0, kUp}}, .under_floor = true});
  EXPECT_EQ(plan_with(policy, MessageClass::kData, {}).sends.size(), 0U);
  std::vector<LinkState> links = three_links();
  for (LinkState& link : links) link.up = false;
  for (const MessageClass c : {MessageClass::kData, MessageClass::kResult}) {
    const std::array<std::size_t, 1> small{1};
    const Plan plan = plan_message(policy, {{.message_class = c}, small}, links, {});
    EXPECT_THAT(plan.sends, IsEmpty());
    EXPECT_FALSE(plan.under_floor);
  }
}

}  // namespace
}  // namespace interneuron
