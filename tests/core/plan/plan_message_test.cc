#include "core/plan/plan_message.h"

#include <gmock/gmock.h>

#include <array>

namespace interneuron::plan_message_test {
namespace {

using plan::plan_message;

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
  for (LinkState& link : links) {
    link.nature.security = 0.5;  // what the policy `secure` asks for
    link.traits.trusted = true;  // and `trusted_only`
  }
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

TEST(PlanMessage, ASlowLinkCarriesACopyOfAResultWhereItIsCheapOrSoonest) {
  constexpr std::array<std::size_t, 1> kResult{3000};
  const QoS qos{.deadline = milliseconds(250),
                .period = milliseconds(100),
                .message_class = MessageClass::kResult};
  const auto over = [&](double up_mbit, double also_mbit, Duration queue_of_up) {
    std::vector<LinkState> links = three_links();
    links[0].rate = DataRate::mbit(up_mbit);
    links[0].queue_up = queue_of_up;
    links[2].rate = DataRate::mbit(also_mbit);
    return plan_message(Scripted({}), {qos, kResult}, links, {}).sends;
  };
  const Assignment up{0, kUp};
  const Assignment also{0, kAlsoUp};
  // Two thirds of either link.
  EXPECT_THAT(over(0.36, 0.36, milliseconds(0)), ElementsAre(up));
  EXPECT_THAT(over(0.36, 0.36, milliseconds(20)), ElementsAre(also));
  // A fifth of it, and nothing that counts.
  EXPECT_THAT(over(1.4, 1.4, milliseconds(0)), ElementsAre(up, also));
  EXPECT_THAT(over(0.36, 20, milliseconds(0)), ElementsAre(also));
  EXPECT_THAT(over(20, 60, milliseconds(0)), ElementsAre(up, also));
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

// --- links that are suspected

// Everything over the first link that is up, and the smallest variant over the
// last one.
class FirstAndLast final : public Policy {
 public:
  std::string_view name() const override { return "first_and_last"; }
  Plan plan(const Offer& offer, std::span<const LinkState> links, const Guidance&) const override {
    std::vector<LinkId> up;
    for (const LinkState& link : links) {
      if (link.up) up.push_back(link.id);
    }
    Plan plan;
    if (up.empty()) return plan;
    plan.sends.push_back({0, up.front()});
    const auto smallest = static_cast<std::uint8_t>(offer.variant_bytes.size() - 1);
    if (up.size() > 1 && smallest > 0) plan.sends.push_back({smallest, up.back()});
    return plan;
  }
  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

// The first one is suspected; the last one has the rate given.
Plan plan_in_doubt(double mbit, std::span<const std::size_t> variant_bytes,
                   milliseconds period = {}) {
  std::vector<LinkState> links = three_links();
  for (LinkState& link : links) {
    link.path = link.up ? PathState::kOk : PathState::kDead;
    link.rtt_p95 = milliseconds(40);
    link.rate = DataRate::mbit(mbit);
  }
  links[0].path = PathState::kSuspect;
  const QoS qos{.deadline = milliseconds(100), .period = period};
  return plan_message(FirstAndLast(), {qos, variant_bytes}, links, {});
}

constexpr std::array<std::size_t, 2> kTwoSmall{128 * 1024, 32 * 1024};

TEST(PlanMessage, GoesRoundALinkThatIsSuspected) {
  EXPECT_THAT(plan_in_doubt(20, std::span(kTwoSmall).first(1)).sends,
              ElementsAre(Assignment{0, kAlsoUp}));
}

TEST(PlanMessage, SendsNothingLessOverASuspectedLink) {
  EXPECT_THAT(plan_in_doubt(20, kTwoSmall).sends, ElementsAre(Assignment{0, kAlsoUp}));
}

TEST(PlanMessage, KeepsAPlanThatDoesNotRestOnASuspectedLink) {
  std::vector<LinkState> links = three_links();
  links[2].path = PathState::kOk;
  links[2].rtt_p95 = milliseconds(40);
  links[2].rate = DataRate::mbit(20);
  links[0].path = PathState::kSuspect;
  const QoS qos{.deadline = milliseconds(100)};
  const Scripted policy({.sends = {{0, kUp}, {0, kAlsoUp}}});
  EXPECT_THAT(plan_message(policy, {qos, kTwoSmall}, links, {}).sends,
              ElementsAre(Assignment{0, kUp}, Assignment{0, kAlsoUp}));
}

TEST(PlanMessage, KeepsToASuspectedLinkWhereTheOthersAreTooLate) {
  // 128 KiB take 56 ms at 20 Mbit/s and 111 ms at 10.
  EXPECT_THAT(plan_in_doubt(10, kTwoSmall).sends,
              ElementsAre(Assignment{0, kUp}, Assignment{1, kAlsoUp}));
  // A round's guard weighs that itself.
  EXPECT_THAT(plan_in_doubt(20, kTwoSmall, milliseconds(100)).sends,
              ElementsAre(Assignment{0, kUp}, Assignment{1, kAlsoUp}));
}

TEST(PlanMessage, UsesSuspectedLinksWhereThereAreNoOthers) {
  std::vector<LinkState> links = three_links();
  links[0].path = links[2].path = PathState::kSuspect;
  const QoS qos{.deadline = milliseconds(100)};
  EXPECT_THAT(plan_message(FirstAndLast(), {qos, kTwoSmall}, links, {}).sends,
              ElementsAre(Assignment{0, kUp}, Assignment{1, kAlsoUp}));
}

}  // namespace
}  // namespace interneuron::plan_message_test
