// Each rule of docs/paper.md, "Down-sampling" and "Holds".
#include "tests/policies/support.h"

namespace interneuron::policy_test::down_sampling_test {
namespace {

const std::vector<std::size_t> kImages(kRawAndSampled.begin(), kRawAndSampled.end());
const std::vector<std::size_t> kWhole{512 * 1024};

TEST(DownSampling, TwoLinks) {
  check("down_sampling", {
                             {"the one with more bandwidth carries raw: it is the faster",
                              kImages,
                              make_links({{1, 60, 50}, {2, 20, 100}}),
                              false,
                              {send(0, 2), send(1, 1)},
                              false},
                             {"the one with more bandwidth carries raw: it is the slower",
                              kImages,
                              make_links({{1, 60, 100}, {2, 20, 50}}),
                              false,
                              {send(0, 1), send(1, 2)},
                              false},
                             {"equal bandwidth: the faster one carries raw",
                              kImages,
                              make_links({{1, 60, 50}, {2, 20, 50}}),
                              false,
                              {send(0, 2), send(1, 1)},
                              false},
                             {"4G cannot carry raw but carries the sampled copy",
                              kImages,
                              make_links({{1, 60, 30}, {2, 20, 100}}),
                              false,
                              {send(0, 2), send(1, 1)},
                              false},
                             {"and so does a 4G link that happens to be faster",
                              kImages,
                              make_links({{1, 10, 30}, {2, 20, 100}}),
                              false,
                              {send(0, 2), send(1, 1)},
                              false},
                             {"degraded: sampled over both",
                              kImages,
                              make_links({{1, 60, 50}, {2, 20, 100}}),
                              true,
                              {send(1, 2), send(1, 1)},
                              false},
                             {"degraded, one of them fit for sampled only",
                              kImages,
                              make_links({{1, 10, 30}, {2, 20, 100}}),
                              true,
                              {send(1, 2), send(1, 1)},
                              false},
                         });
}

// Where there are more than two forms, raw is the one that the guard names, and sampled the next.
TEST(DownSampling, TheGuardNamesTheBestVariantOfMany) {
  const auto links = make_links({{1, 60, 50}, {2, 20, 100}});
  const std::vector<std::size_t> sizes{512 * 1024, 256 * 1024, 128 * 1024, 64 * 1024};
  const PolicySet policies = builtin_policies();
  const Policy& rule = *find_policy(policies, "down_sampling");
  using ::testing::ElementsAre;
  const auto plan = [&](bool degraded, std::optional<std::uint8_t> variant) {
    const Guidance guidance{.degraded = degraded, .variant = variant};
    return setting_out(rule.plan({frames_at_10_hz(), sizes}, links, guidance));
  };
  EXPECT_THAT(plan(false, std::nullopt), ElementsAre(send(0, 2), send(1, 1)));
  EXPECT_THAT(plan(false, 1), ElementsAre(send(1, 2), send(2, 1)));
  EXPECT_THAT(plan(false, 2), ElementsAre(send(2, 2), send(3, 1)));
  EXPECT_THAT(plan(true, 3), ElementsAre(send(3, 2), send(3, 1)));
}

TEST(DownSampling, MoreThanTwoLinks) {
  check("down_sampling", {
                             {"the two with the best delay",
                              kImages,
                              make_links({{1, 60, 300}, {2, 20, 100}, {3, 30, 200}, {4, 90, 900}}),
                              false,
                              {send(0, 3), send(1, 2)},
                              false},
                             {"the first must be fit for raw, the second only for sampled",
                              kImages,
                              make_links({{1, 10, 30}, {2, 15, 20}, {3, 30, 100}, {4, 40, 200}}),
                              false,
                              {send(0, 3), send(1, 1)},
                              false},
                             {"degraded: the same two",
                              kImages,
                              make_links({{1, 10, 30}, {2, 15, 20}, {3, 30, 100}, {4, 40, 200}}),
                              true,
                              {send(1, 3), send(1, 1)},
                              false},
                             {"links under the sampled floor and links that are down are not taken",
                              kImages,
                              make_links({{1, 10, 9}, {2, 20, 50}, {3, 30, 60}}, {4}),
                              false,
                              {send(0, 3), send(1, 2)},
                              false},
                         });
}

TEST(DownSampling, OneEligibleLink) {
  check("down_sampling",
        {
            {"normal: raw", kImages, make_links({{1, 60, 50}}), false, {send(0, 1)}, false},
            {"degraded: sampled", kImages, make_links({{1, 60, 50}}), true, {send(1, 1)}, false},
            {"the other is under the sampled floor",
             kImages,
             make_links({{1, 60, 50}, {2, 20, 9}}),
             false,
             {send(0, 1)},
             false},
            {"the other is under the sampled floor, degraded",
             kImages,
             make_links({{1, 60, 50}, {2, 20, 9}}),
             true,
             {send(1, 1)},
             false},
            {"the other is down",
             kImages,
             make_links({{1, 60, 50}}, {2}),
             false,
             {send(0, 1)},
             false},
        });
}

TEST(DownSampling, NoLinkIsFitForRaw) {
  check("down_sampling",
        {
            {"sampled over the fastest that carries it, reported",
             kImages,
             make_links({{1, 60, 40}, {2, 20, 30}, {3, 10, 9}}),
             false,
             {send(1, 2)},
             true},
            {"degraded, nobody asks for raw: sampled over both",
             kImages,
             make_links({{1, 60, 40}, {2, 20, 30}, {3, 10, 9}}),
             true,
             {send(1, 2), send(1, 1)},
             false},
            {"degraded, one carries sampled",
             kImages,
             make_links({{1, 60, 40}, {2, 20, 9}}),
             true,
             {send(1, 1)},
             false},
            {"none carries sampled: over the fastest, reported",
             kImages,
             make_links({{1, 60, 10}, {2, 20, 9}}),
             false,
             {send(1, 2)},
             true},
            {"none carries sampled, degraded",
             kImages,
             make_links({{1, 60, 10}, {2, 20, 9}}),
             true,
             {send(1, 2)},
             true},
            {"none is up", kImages, make_links({}, {1, 2}), false, {}, false},
            {"none is up, degraded", kImages, make_links({}, {1, 2}), true, {}, false},
        });
}

TEST(DownSampling, NoSmallerVariant) {
  check("down_sampling", {
                             {"whole over the fastest",
                              kWhole,
                              make_links({{1, 60, 100}, {2, 20, 50}}),
                              false,
                              {send(0, 2)},
                              false},
                             {"whole over the fastest that carries it",
                              kWhole,
                              make_links({{1, 60, 100}, {2, 20, 30}}),
                              false,
                              {send(0, 1)},
                              false},
                             {"degraded: whole over the two fastest",
                              kWhole,
                              make_links({{1, 60, 100}, {2, 20, 50}, {3, 40, 60}}),
                              true,
                              {send(0, 2), send(0, 3)},
                              false},
                             {"none carries it: over the fastest, reported",
                              kWhole,
                              make_links({{1, 60, 40}, {2, 20, 30}}),
                              false,
                              {send(0, 2)},
                              true},
                             {"none carries it, degraded",
                              kWhole,
                              make_links({{1, 60, 40}, {2, 20, 30}}),
                              true,
                              {send(0, 2)},
                              true},
                             {"a small one",
                              {5 * 1024},
                              make_links({{1, 60, 40}, {2, 20, 30}}),
                              true,
                              {send(0, 2), send(0, 1)},
                              false},
                             {"none is up", kWhole, make_links({}, {1}), true, {}, false},
                         });
}

TEST(DownSampling, MoreThanTwoVariants) {
  const std::vector<std::size_t> three{512 * 1024, 128 * 1024, 32 * 1024};
  check("down_sampling", {
                             {"raw and the next",
                              three,
                              make_links({{1, 60, 50}, {2, 20, 100}}),
                              false,
                              {send(0, 2), send(1, 1)},
                              false},
                             {"degraded: the next",
                              three,
                              make_links({{1, 60, 50}, {2, 20, 100}}),
                              true,
                              {send(1, 2), send(1, 1)},
                              false},
                         });
}

TEST(DownSampling, LinksNotMeasuredYet) {
  check("down_sampling", {
                             {"none is: the first carries raw",
                              kImages,
                              make_links({{1, 0, 0}, {2, 0, 0}}),
                              false,
                              {send(0, 1), send(1, 2)},
                              false},
                             {"a measured delay comes first",
                              kImages,
                              make_links({{1, 0, 0}, {2, 90, 50}, {3, 95, 60}}),
                              false,
                              {send(0, 3), send(1, 2)},
                              false},
                             {"a measured rate comes first",
                              kImages,
                              make_links({{1, 20, 0}, {2, 90, 50}}),
                              false,
                              {send(0, 2), send(1, 1)},
                              false},
                             {"but not one measured to be too low for raw",
                              kImages,
                              make_links({{1, 20, 0}, {2, 90, 30}}),
                              false,
                              {send(0, 1), send(1, 2)},
                              false},
                         });
}

TEST(DownSampling, ReceiverHoldsSampledOnlyWhileRawMayCome) {
  const PolicySet policies = builtin_policies();
  const Policy& policy = *find_policy(policies, "down_sampling");
  struct Row {
    Arrival arrival;
    Merge merge;
  };
  for (const Row& row : {
           Row{{.variant = 0, .best_planned = 0, .degraded = false}, Merge::kDeliver},
           Row{{.variant = 1, .best_planned = 0, .degraded = false}, Merge::kHold},
           Row{{.variant = 1, .best_planned = 1, .degraded = false}, Merge::kDeliver},
           Row{{.variant = 0, .best_planned = 0, .degraded = true}, Merge::kDeliver},
           Row{{.variant = 1, .best_planned = 0, .degraded = true}, Merge::kDeliver},
           Row{{.variant = 1, .best_planned = 1, .degraded = true}, Merge::kDeliver},
       }) {
    EXPECT_EQ(policy.merge(row.arrival), row.merge)
        << "variant " << int{row.arrival.variant} << " of best " << int{row.arrival.best_planned}
        << (row.arrival.degraded ? ", degraded" : "");
  }
}

}  // namespace
}  // namespace interneuron::policy_test::down_sampling_test
