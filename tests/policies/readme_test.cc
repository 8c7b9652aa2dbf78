// The example of policies/README.md compiles, works, and is what the page shows.
#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>

#include "interneuron/requirement.h"
#include "tests/places.h"
#include "tests/policies/support.h"

namespace {

// --- example
// insured: the best variant over the link that suits the message best; where that link loses
// packets, the smallest variant too, over the most reliable of the others.
class Insured final : public interneuron::Policy {
 public:
  std::string_view name() const override { return "insured"; }

  interneuron::Plan plan(const interneuron::Offer& offer,
                         std::span<const interneuron::LinkState> links,
                         const interneuron::Guidance& guidance) const override {
    const std::size_t smallest = offer.variant_bytes.size() - 1;
    // The guard may name the best variant to be sent.
    const std::size_t named = std::min<std::size_t>(guidance.variant.value_or(0), smallest);
    const std::size_t main = guidance.degraded ? smallest : named;
    interneuron::Requirement suits{
        .min_rate = interneuron::rate_floor(offer.qos, offer.variant_bytes[main]),
        .weights = offer.qos.needs,
        .links = 1};
    interneuron::Plan plan;
    interneuron::Links chosen = match(suits, links);
    if (chosen.empty()) {  // no link can carry it: do the best there is, and say so
      suits.min_rate = {};
      chosen = match(suits, links);
      plan.under_floor = !chosen.empty();
    }
    if (chosen.empty()) return plan;  // no link is up
    plan.sends.push_back({static_cast<std::uint8_t>(main), chosen.front().id});
    if (chosen.front().loss < kWorthInsuring) return plan;

    const interneuron::Requirement insures{
        .min_rate = interneuron::rate_floor(offer.qos, offer.variant_bytes[smallest]),
        .weights = {.reliability = 1}};
    for (const interneuron::LinkState& link : match(insures, links)) {
      if (link.id == chosen.front().id) continue;
      plan.sends.push_back({static_cast<std::uint8_t>(smallest), link.id});
      break;
    }
    return plan;
  }

  interneuron::Merge merge(const interneuron::Arrival& arrival) const override {
    const bool better_may_come = arrival.variant > arrival.best_planned && !arrival.degraded;
    return better_may_come ? interneuron::Merge::kHold : interneuron::Merge::kDeliver;
  }

 private:
  static constexpr double kWorthInsuring = 0.01;  // share of packets lost
};
// --- end

std::string read(const char* path) {
  std::ifstream in(interneuron::places::source() + path);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string between(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t from = text.find(begin);
  if (from == std::string::npos) return "nothing begins with " + begin;
  const std::size_t first = from + begin.size();
  return text.substr(first, text.find(end, first) - first);
}

TEST(PoliciesReadme, ShowsTheExampleBelow) {
  EXPECT_EQ(between(read("/policies/README.md"), "```cpp\n", "```"),
            between(read("/tests/policies/readme_test.cc"), "\n// --- example\n", "// --- end"));
}

using interneuron::policy_test::frames_at_10_hz;
using interneuron::policy_test::kRawAndSampled;
using interneuron::policy_test::make_links;
using interneuron::policy_test::send;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(PoliciesReadme, TheExampleInsuresWhatALossyLinkCarries) {
  const Insured policy;
  interneuron::QoS qos = frames_at_10_hz();
  qos.needs = {.delay = 1};
  const interneuron::Offer offer{qos, kRawAndSampled};
  auto links = make_links({{1, 60, 50}, {2, 20, 100}});
  EXPECT_THAT(policy.plan(offer, links, {}).sends, ElementsAre(send(0, 2)));
  links[1].loss = 0.02;
  EXPECT_THAT(policy.plan(offer, links, {}).sends, ElementsAre(send(0, 2), send(1, 1)));
  EXPECT_THAT(policy.plan(offer, links, {.degraded = true}).sends,
              ElementsAre(send(1, 2), send(1, 1)));
  EXPECT_THAT(policy.plan(offer, {}, {}).sends, IsEmpty());
  EXPECT_TRUE(policy.plan(offer, make_links({{1, 60, 5}}), {}).under_floor);
}

TEST(PoliciesReadme, TheExampleHoldsTheInsuranceUntilTheStageDeadline) {
  const Insured policy;
  EXPECT_EQ(policy.merge({.variant = 1}), interneuron::Merge::kHold);
  EXPECT_EQ(policy.merge({.variant = 0}), interneuron::Merge::kDeliver);
  EXPECT_EQ(policy.merge({.variant = 1, .degraded = true}), interneuron::Merge::kDeliver);
}

}  // namespace
