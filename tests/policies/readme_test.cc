// What policies/README.md says: its table has a row for each built-in policy, what the rows of
// `secure` and `trusted_only` promise is kept, and its example compiles, works and is the one
// below.
#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
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

// The column `sends` of the table of policies, by the names of the rows.
std::map<std::string, std::string> table_of_policies() {
  std::istringstream rows(between(read("/policies/README.md"), "|---|---|---|---|\n", "\n\n"));
  std::map<std::string, std::string> out;
  for (std::string row; std::getline(rows, row);) {
    const std::string name = between(row, "| `", "` |");
    out[name] = between(row, "` | ", " |");
  }
  return out;
}

TEST(PoliciesReadme, HasARowForEachPolicyAndAPolicyForEachRow) {
  std::vector<std::string> rows;
  for (const auto& [name, sends] : table_of_policies()) rows.push_back(name);
  std::vector<std::string> policies;
  for (const auto& policy : interneuron::builtin_policies()) policies.emplace_back(policy->name());
  EXPECT_THAT(rows, testing::UnorderedElementsAreArray(policies));
}

using interneuron::policy_test::frames_at_10_hz;
using interneuron::policy_test::kRawAndSampled;
using interneuron::policy_test::make_links;
using interneuron::policy_test::send;
using testing::ElementsAre;
using testing::IsEmpty;

// What the rows may promise of a link, and whether a link that keeps the promise is used.
struct Promise {
  const char* words;
  bool (*is_kept_by)(const interneuron::LinkState&);
  std::string_view refusal;
};
constexpr Promise kPromises[] = {
    {"as `down_sampling`, over links whose packets are encrypted or whose network is trusted; else "
     "nothing",
     [](const interneuron::LinkState& l) { return l.encrypted || l.traits.trusted; },
     interneuron::kInsecure},
    {"as `down_sampling`, over links whose network is trusted, encrypted or not; else nothing",
     [](const interneuron::LinkState& l) { return l.traits.trusted; }, interneuron::kUntrusted}};

// What a policy does over one link, and over one of both that it may use, as the row says.
void expect_kept(const interneuron::Policy& policy, const Promise& promise) {
  const interneuron::PolicySet all = interneuron::builtin_policies();
  const auto* plain = interneuron::policy_test::find_policy(all, "down_sampling");
  const interneuron::Offer offer{frames_at_10_hz(), kRawAndSampled};
  for (const bool encrypted : {false, true}) {
    for (const bool trusted : {false, true}) {
      auto links = make_links({{1, 60, 50}});
      links[0].encrypted = encrypted;
      links[0].traits.trusted = trusted;
      interneuron::link::score(links);
      SCOPED_TRACE(testing::Message() << "encrypted " << encrypted << ", trusted " << trusted);
      const interneuron::Plan plan = policy.plan(offer, links, {});
      const bool used = promise.is_kept_by(links[0]);
      EXPECT_EQ(policy.allows(links[0]), used);
      EXPECT_EQ(plan.sends,
                used ? plain->plan(offer, links, {}).sends : interneuron::Assignments{});
      EXPECT_EQ(plan.refused, used ? std::string_view{} : promise.refusal);
    }
  }
}

TEST(PoliciesReadme, TheRowsOfSecureAndTrustedOnlyAreTrue) {
  auto rows = table_of_policies();
  const interneuron::PolicySet all = interneuron::builtin_policies();
  for (const char* name : {"secure", "trusted_only"}) {
    SCOPED_TRACE(name);
    const auto* promise = std::ranges::find(kPromises, rows[name], &Promise::words);
    ASSERT_NE(promise, std::end(kPromises)) << "this test does not know what that row means";
    expect_kept(*interneuron::policy_test::find_policy(all, name), *promise);
  }
}

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
