// Links that are granted in bursts, or shaped or policed by a token bucket, are believed to carry
// what they carry, and used.
#include "echo_duo.h"
#include "lab/sim/duo.h"

namespace interneuron::sim::grants_test {
namespace {

constexpr double kMbit = 30;

emu::LinkProfile granted(Duration every) {
  emu::LinkProfile link = constant_link("a", 40, kMbit, 60);
  link.up.grant_every = every;
  return link;
}

class Grants : public testing::TestWithParam<Duration> {};

// Nine tenths of the rate at 10 Hz, so that a message takes 90 ms of its 150 at the rate.
TEST_P(Grants, TheRateIsThatOfManyGrants) {
  const std::size_t bytes = 316'000;
  Duo duo({granted(GetParam())}, {.variants = {bytes}, .deadline = 150ms});
  duo.send(Duo::kBegin, kSanitized ? 60 : 230);
  duo.run();
  EXPECT_NEAR(duo.link(0).rate.mbit(), kMbit, 0.2 * kMbit);
  EXPECT_LE(duo.missed(30), 2U);
}

// Each message drains the bucket, which is full again before the next one.
TEST(Buckets, TheRateIsThatAtWhichTheyFill) {
  constexpr double kFill = 10;
  for (const std::size_t kbyte : {8U, 32U}) {
    emu::LinkProfile link = constant_link("a", 40, 100, 60);
    link.up.shape = {DataRate::mbit(kFill), kbyte * 1000};
    Duo duo({link}, {.variants = {82'000}, .deadline = 150ms});
    duo.send(Duo::kBegin, kSanitized ? 60 : 230);
    duo.run();
    EXPECT_NEAR(duo.link(0).rate.mbit(), kFill, 0.2 * kFill) << kbyte;
    EXPECT_EQ(duo.missed(30), 0U) << kbyte;
  }
}

struct Policed {
  double mbit = 0;
  Duration bucket{};
  double load = 0;
  // The least share of messages that is on time, where 1 / load of them could be, and the largest
  // share of packets that the policer drops, both from the sixth second on.
  double on_time = 0;
  double dropped = 0;
  // How long a message takes at the policed rate.
  Duration message = 50ms;
};

class Policers : public testing::TestWithParam<Policed> {};

// Messages as many as the load is. What exceeds it is dropped without a queue. Where one takes 100
// ms and more than the bucket, there is no time to send again what was dropped of it.
TEST_P(Policers, NextToNothingIsDropped) {
  const Policed& p = GetParam();
  emu::LinkProfile link = constant_link("a", 40, 1000, 1000);
  const double bytes_a_second = p.mbit * 1e6 / 8;
  link.up.police = {DataRate::mbit(p.mbit),
                    static_cast<std::size_t>(bytes_a_second * to_seconds(p.bucket))};
  const double seconds = to_seconds(p.message);
  const Duration period{static_cast<std::int64_t>(1e9 * seconds / p.load)};
  Duo duo({link}, {.variants = {static_cast<std::size_t>(bytes_a_second * seconds / 1.066)},
                   .deadline = 150ms,
                   .period = period,
                   .seed = 70011});
  const auto count = static_cast<std::size_t>((kSanitized ? 9s : 20s) / period);
  const auto settled = static_cast<std::size_t>(6s / period);
  emu::DirectionStats before;
  duo.world.at(Duo::kBegin + 6s, [&] { before = duo.world.stats(LinkId{0}, true); });
  duo.send(Duo::kBegin, count);
  duo.run();
  const emu::DirectionStats& after = duo.world.stats(LinkId{0}, true);
  const auto sent = static_cast<double>(after.packets_in - before.packets_in);
  EXPECT_LE(static_cast<double>(after.policed - before.policed), p.dropped * sent);
  EXPECT_LE(static_cast<double>(duo.missed(settled)),
            (1 - p.on_time) * static_cast<double>(count - settled));
}

INSTANTIATE_TEST_SUITE_P(
    Buckets, Policers,
    testing::Values(Policed{10, 10ms, 0.95, 0.97, 0.03}, Policed{10, 50ms, 0.5, 1, 0.05},
                    Policed{10, 50ms, 1.05, 0.81, 0.03}, Policed{10, 50ms, 1.5, 0.56, 0.03},
                    Policed{10, 200ms, 2, 0.42, 0.03}, Policed{50, 20ms, 0.95, 0.97, 0.03},
                    Policed{50, 100ms, 1.5, 0.56, 0.03}, Policed{10, 15ms, 0.8, 0.97, 0.01, 100ms},
                    Policed{10, 20ms, 0.95, 0.98, 0.01, 100ms},
                    Policed{50, 10ms, 0.95, 0.98, 0.01, 100ms}));

INSTANTIATE_TEST_SUITE_P(Measure, Grants, testing::Values(5ms, 10ms, 20ms, 40ms),
                         [](const auto& p) {
                           return std::to_string(std::lround(to_ms(p.param))) + "ms";
                         });

}  // namespace
}  // namespace interneuron::sim::grants_test
