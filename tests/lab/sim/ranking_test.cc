// Links of random true delay, rate and loss are told apart and put in the true order, idle and
// under load. "Decided" is link::compare() (src/core/link/nature.h), asked 30 s after the start.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "core/link/nature.h"
#include "support.h"

namespace interneuron::sim::ranking_test {
namespace {

using link::Field;

constexpr std::uint8_t kLinks = 4;

struct Truth {
  double delay_ms = 0;  // what one packet takes up, p95
  double rate_mbit = 0;
  double loss = 0;
};

struct Drawn {
  Truth truth;
  emu::LinkProfile profile;
};

double log_uniform(std::mt19937_64& random, double low, double high) {
  return std::exp(std::uniform_real_distribution<double>(std::log(low), std::log(high))(random));
}

// A round trip of 10 to 200 ms with a jitter of up to a tenth, 0.1 to 10 % loss.
Drawn draw(std::mt19937_64& random, double least_mbit, double most_mbit) {
  const double level = log_uniform(random, 10, 200);
  const double jitter = std::uniform_real_distribution<double>(0, 0.1)(random) * level;
  const double rate = log_uniform(random, least_mbit, most_mbit);
  const double loss = log_uniform(random, 0.001, 0.1);
  Drawn d{{}, constant_link("random", level, rate, rate, loss)};
  for (auto& state : d.profile.delay.states) state.jitter_sd_ms = jitter;
  d.profile.delay.min_ms = 0;
  d.profile.delay.max_ms = 10 * level;
  // Both ways have a half-normal jitter of their own: the p95 of their mean is 1.5 sd above zero.
  d.truth = {(level + 1.5 * jitter) / 2, rate, loss};
  return d;
}

struct Tally {
  int pairs = 0;  // differ enough by the truth
  int decided = 0;
  int right = 0;
  void count(std::partial_ordering said, bool a_is_better) {
    ++pairs;
    if (said == std::partial_ordering::unordered) return;
    ++decided;
    if ((said == std::partial_ordering::greater) == a_is_better) ++right;
  }
  void print(const char* what) const {
    std::printf("%-24s %4d pairs, %4d decided (%.1f %%), %4d of them right (%.2f %%)\n", what,
                pairs, decided, 100.0 * decided / std::max(pairs, 1), right,
                100.0 * right / std::max(decided, 1));
  }
};

struct Tallies {
  Tally delay, rate, loss;
};

EndpointOptions host(std::uint32_t session, bool accepts) {
  PipelineConfig pipeline{.stages = {StageKind::kCommunication, StageKind::kCommunication},
                          .policy = "duplicate"};
  EndpointOptions o;
  o.session = SessionId{session};
  if (!accepts) o.pipelines = {pipeline};
  o.policies = builtin_policies();
  o.accept_peers = accepts;
  return o;
}

// A vehicle with kLinks links to a roadside unit; under load a message of 94 packets at 10 Hz goes
// over all of them.
void run(std::uint64_t seed, bool loaded, double rate_margin, Tallies& tallies) {
  std::mt19937_64 random(seed);
  World world(seed);
  const HostId vehicle = world.add_host(host(1, false));
  const HostId road = world.add_host(host(2, true));
  std::vector<Truth> truths;
  for (std::uint8_t i = 0; i < kLinks; ++i) {
    const Drawn drawn = loaded ? draw(random, 15, 150) : draw(random, 2, 200);
    truths.push_back(drawn.truth);
    world.add_link(vehicle, road, LinkId{i}, "l" + std::to_string(i),
                   emu::Link(drawn.profile, seed * kLinks + i));
  }
  const PeerId peer = world.connect(vehicle, road);
  if (loaded) {
    for (Duration t = 500ms; t < 30s; t += 100ms) {
      world.at(t, [&world, vehicle, peer] {
        Endpoint& e = world.endpoint(vehicle);
        const TimePoint now = world.local_time(vehicle);
        const RoundRef round = e.begin_round(now, PipelineId{0});
        e.submit(now, round, {Bytes(128'000)}, MessageClass::kData, peer);
        world.flush(vehicle);
      });
    }
  }
  world.run_until(30s);
  const auto links = world.endpoint(vehicle).links(world.local_time(vehicle), peer);
  ASSERT_EQ(links.size(), kLinks);
  for (std::size_t i = 0; i < kLinks; ++i) {
    for (std::size_t j = i + 1; j < kLinks; ++j) {
      const Truth& a = truths[i];
      const Truth& b = truths[j];
      if (std::max(a.delay_ms, b.delay_ms) >= 1.1 * std::min(a.delay_ms, b.delay_ms)) {
        tallies.delay.count(link::compare(links[i], links[j], Field::kDelay),
                            a.delay_ms < b.delay_ms);
      }
      if (std::max(a.rate_mbit, b.rate_mbit) >= rate_margin * std::min(a.rate_mbit, b.rate_mbit)) {
        tallies.rate.count(link::compare(links[i], links[j], Field::kBandwidth),
                           a.rate_mbit > b.rate_mbit);
      }
      const auto [low, high] = std::minmax(a.loss, b.loss);
      if (high >= 2 * low && high >= low + 0.005) {
        tallies.loss.count(link::compare(links[i], links[j], Field::kReliability), a.loss < b.loss);
      }
    }
  }
}

void expect_ordered(const Tally& tally, const char* what) {
  tally.print(what);
  if (kSanitized) return;
  EXPECT_GE(tally.decided, 0.8 * tally.pairs) << what;
  EXPECT_GE(tally.right, 0.99 * tally.decided) << what;
}

TEST(Ranking, IdleLinksAreOrderedAsTheTruthWithin30Seconds) {
  Tallies tallies;
  for (std::uint64_t seed = 1; seed <= (kSanitized ? 4 : 60); ++seed)
    run(seed, false, 1.4, tallies);
  expect_ordered(tallies.delay, "idle, delay");
  expect_ordered(tallies.rate, "idle, rate");
  expect_ordered(tallies.loss, "idle, loss");
}

TEST(Ranking, LoadedLinksAreOrderedAsTheTruthWithin30Seconds) {
  Tallies tallies;
  for (std::uint64_t seed = 1; seed <= (kSanitized ? 1 : 60); ++seed)
    run(seed, true, 1.25, tallies);
  expect_ordered(tallies.delay, "loaded, delay");
  expect_ordered(tallies.rate, "loaded, rate");
  expect_ordered(tallies.loss, "loaded, loss");
}

}  // namespace
}  // namespace interneuron::sim::ranking_test
