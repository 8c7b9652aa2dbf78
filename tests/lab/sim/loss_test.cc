// Messages of a hundred fragments over two links that lose some of them at random.
#include <cstdio>

#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::loss_test {
namespace {

constexpr std::size_t kMessages = kSanitized ? 300 : 2000;

// How many of them are missed over 60 Mbit/s, 15 ms and 20 Mbit/s, 30 ms one way.
double missed(const char* policy, double loss, std::uint64_t seed) {
  Duo s({constant_link("a", 30, 60, 60, loss), constant_link("b", 60, 20, 20, loss)},
        {.policy = policy, .seed = seed});
  s.send(2s, kMessages);
  s.run();
  std::printf("%s, %.0f %% loss, seed %llu: %zu of %zu missed\n", policy, 100 * loss,
              static_cast<unsigned long long>(seed), s.missed(), kMessages);
  return static_cast<double>(s.missed()) / static_cast<double>(kMessages);
}

class Loss : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Loss, OfOneLinkIsMadeUpForByTheOther) {
  EXPECT_EQ(missed("best_link", 0, GetParam()), 0);
  EXPECT_LE(missed("best_link", 0.01, GetParam()), 0.01);
}

TEST_P(Loss, OfBothLinksIsMadeUpForInTime) {
  EXPECT_EQ(missed("duplicate", 0, GetParam()), 0);
  // All three copies of one of a hundred fragments are lost once in ten thousand messages.
  EXPECT_LE(missed("duplicate", 0.01, GetParam()), 0.0005);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Loss, testing::Values(1, 2, 3),
                         [](const auto& p) { return "Seed" + std::to_string(p.param); });

}  // namespace
}  // namespace interneuron::sim::loss_test
