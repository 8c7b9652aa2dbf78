// With repair off and single-fragment messages, fallbacks caused by independent loss have a closed
// form: each way fails with the product of the losses of the links that its message took.
#include <cmath>

#include "support.h"

namespace interneuron::sim::closed_form_test {
namespace {

constexpr std::uint32_t kRounds = kSanitized ? 2'000 : 10'000;
constexpr double kLossA = 0.20;
constexpr double kLossB = 0.05;

// Rounds answered locally when each direction of links A and B loses packets independently.
std::uint32_t fallbacks(const std::string& policy, std::uint64_t seed) {
  OffloadOptions o;
  o.seed = seed;
  o.rounds = kRounds;
  o.profiles = {constant_link("a", 20, 100, 100, kLossA), constant_link("b", 30, 100, 100, kLossB)};
  o.policy = policy;
  o.ablation.repair = false;
  o.variant_bytes = {600, 600};
  o.result_bytes = 600;
  o.top_level = 0;
  return kRounds - run_offload(o).on_time();
}

// Within four standard deviations of the binomial.
void expect_share(std::uint32_t count, double p) {
  const double n = kRounds;
  EXPECT_NEAR(count, n * p, 4 * std::sqrt(n * p * (1 - p))) << "expected " << n * p;
}

TEST(ClosedForm, DuplicateFailsWhenBothCopiesOfEitherMessageAreLost) {
  // The result goes over every link as well, so each direction fails with the product of the
  // losses.
  const double both = kLossA * kLossB;
  expect_share(fallbacks("duplicate", 11), 1 - (1 - both) * (1 - both));
}

TEST(ClosedForm, BestLinkFailsWithItsOneLinkUp) {
  // The uplink takes the link of the smaller delay (a); the result goes over both.
  expect_share(fallbacks("best_link", 12), 1 - (1 - kLossA) * (1 - kLossA * kLossB));
}

}  // namespace
}  // namespace interneuron::sim::closed_form_test
