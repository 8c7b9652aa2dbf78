// The guard's decisions do not depend on the hosts' clocks (docs/paper.md, "Clock offset").
#include <algorithm>
#include <array>

#include "support.h"

namespace interneuron::sim::clock_test {
namespace {

constexpr std::uint32_t kRounds = kSanitized ? 60 : 300;

// Everything that the guard decided in a round.
struct Decision {
  Outcome outcome{};
  Duration e2e{};
  std::int16_t x = 0;
  bool recovering = false;
  bool degraded_final = false;
  int variant = -1;
  bool degraded = false;
  std::size_t level = 0;
  Verdict verdict;
  friend bool operator==(const Decision&, const Decision&) = default;
};

std::vector<Decision> decisions(std::uint64_t seed, ClockError vehicle, ClockError road) {
  OffloadOptions o = drive(seed, kRounds);
  o.vehicle_clock = vehicle;
  o.road_clock = road;
  std::vector<Decision> out;
  for (const OffloadRound& r : run_offload(o).rounds) {
    Decision d;
    d.outcome = r.done.outcome;
    d.e2e = r.done.e2e;
    d.x = r.done.x_permille;
    d.recovering = r.done.recovering;
    d.degraded_final = r.done.degraded_final;
    if (r.at_road) {
      d.variant = r.at_road->variant;
      d.degraded = r.at_road->degraded;
      d.level = r.at_road->level;
      d.verdict = r.at_road->verdict;
    }
    out.push_back(d);
  }
  return out;
}

// The first round that was decided differently, or the number of rounds.
std::size_t first_difference(const std::vector<Decision>& a, const std::vector<Decision>& b) {
  return static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
}

// Both clocks are off in each run, by offsets whose sum and difference are never zero.
TEST(Clock, DecisionsAreBitIdenticalForAnyOffset) {
  const Duration odd = 3600s + 7ns;  // no multiple of any tick
  const std::array offsets{Duration(1h), Duration(24h), odd, Duration(-1h), Duration(-24h), -odd};
  for (const std::uint64_t seed : {1ULL, 2ULL, 7ULL}) {
    const auto plain = decisions(seed, {}, {});
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      const Duration vehicle = offsets[i];
      const Duration road = offsets[(i + 1) % offsets.size()];
      EXPECT_EQ(first_difference(decisions(seed, {vehicle, 0}, {road, 0}), plain), kRounds)
          << "seed " << seed << ", clocks of vehicle and road off by " << vehicle.count() << " and "
          << road.count() << " ns";
    }
  }
}

// The exact bound for drift is a property of the guard alone
// (tests/core/guard/paper_observer_test.cc): here drift also moves the instants of heartbeats, and
// with them which packets a lossy link takes. What must hold: every answer, hardly a change.
TEST(Clock, DriftCostsNothing) {
  for (const std::uint64_t seed : {1ULL, 5ULL}) {
    const std::uint32_t plain = run_offload(drive(seed, kRounds)).on_time();
    for (const std::int64_t ppm : {100, -100}) {
      OffloadOptions o = drive(seed, kRounds);
      o.road_clock = {0s, ppm};
      const OffloadResult r = run_offload(o);
      for (const OffloadRound& round : r.rounds) EXPECT_EQ(round.answers, 1U);
      EXPECT_NEAR(r.on_time(), plain, 0.02 * kRounds) << "seed " << seed << " ppm " << ppm;
    }
  }
}

}  // namespace
}  // namespace interneuron::sim::clock_test
