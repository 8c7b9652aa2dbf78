// Links that fall silent, and links that come back.
#include <cstdio>

#include "echo_duo.h"

namespace interneuron::sim::outage_test {
namespace {

std::vector<emu::LinkProfile> pair_of(double rtt_a, double rtt_b) {
  return {constant_link("a", rtt_a, 100, 100), constant_link("b", rtt_b, 60, 60)};
}

TEST(Outage, UnderLoadIsNoticedWithin100MsAndWhatWasInFlightArrivesOverTheOther) {
  Duration worst{};
  for (int step = 0; step < 20; ++step) {
    EchoDuo duo(pair_of(30, 50));
    duo.stream(1s, 30, 128'000);  // 10 ms of every 100 on link 0
    const Duration silent = 3s + 1ms + step * 450us;
    duo.cut(silent, 0);
    duo.world.run_until(4s);
    const auto noticed = duo.when(duo.vehicle, 0, PathState::kPulled, silent);
    ASSERT_TRUE(noticed) << step;
    worst = std::max(worst, *noticed - silent);
    EXPECT_LE(*noticed - silent, 100ms) << step;
    EXPECT_EQ(duo.on_time(), static_cast<int>(duo.done.size())) << step;
  }
  std::printf("silent outage under load noticed within %.1f ms\n", to_ms(worst));
}

TEST(Outage, OfAnIdleLinkIsNoticedWithinThreeHeartbeats) {
  for (const bool active : {true, false}) {
    const Duration heartbeat = active ? 50ms : 300ms;
    for (int step = 0; step < 10; ++step) {
      EchoDuo duo(pair_of(30, 50));
      if (active) duo.stream(1s, 100, 10'000);  // on link 0
      const Duration silent = 9s + step * heartbeat / 10;
      duo.cut(silent, 1);
      duo.world.run_until(silent + 3s);
      for (const HostId host : {duo.vehicle, duo.road}) {
        const auto noticed = duo.when_not_ok(host, 1, silent);
        ASSERT_TRUE(noticed) << step;
        // The last one before the cut was on its way for 25 ms.
        EXPECT_LE(*noticed - silent, 3 * heartbeat + 25ms) << step;
      }
      EXPECT_EQ(duo.link(1).path, PathState::kPulled);
      EXPECT_FALSE(duo.link(1).up);
    }
  }
}

TEST(Outage, OfTheLastLinkTakesNothingAway) {
  EchoDuo duo({constant_link("a", 30, 100, 100)});
  duo.stream(1s, 40, 50'000);
  duo.cut(2s + 2ms, 0);
  duo.cut(2s + 500ms, 0, false);
  duo.world.run_until(2s + 400ms);
  EXPECT_TRUE(duo.link(0).up);
  EXPECT_EQ(duo.link(0).path, PathState::kSuspect);
  duo.world.run_until(6s);
  EXPECT_EQ(duo.link(0).path, PathState::kOk);
  EXPECT_GE(duo.on_time(), 33);
}

TEST(Outage, AStallIsOverWithTheFirstSignOfLife) {
  EchoDuo duo(pair_of(30, 50));
  duo.stream(1s, 40, 128'000);
  duo.cut(3s + 5ms, 0);
  duo.cut(3s + 405ms, 0, false);
  duo.world.run_until(6s);
  const auto back = duo.when(duo.vehicle, 0, PathState::kOk, 3s + 405ms);
  ASSERT_TRUE(back);
  EXPECT_LE(*back - (3s + 405ms), 50ms + 15ms + 1ms);  // a heartbeat and its way
  EXPECT_EQ(duo.on_time(), 40);
}

// Both variants are together larger than the largest message, and both are incomplete at once.
TEST(Outage, OfTheLinkOfAHugeMessageLeavesTheSmallerVariant) {
  PipelineConfig pipeline = EchoDuo::best_link();
  pipeline.policy = "down_sampling";
  pipeline.deadline = 300ms;
  pipeline.period = 1s;
  pipeline.guard = GuardKind::kPaper;
  EchoDuo duo({constant_link("a", 10, 1000, 1000), constant_link("b", 16, 100, 100)}, 1, {},
              pipeline);
  for (int i = 0; i < 20; ++i) {
    duo.world.at(2s + i * 100ms, [&duo] { duo.round({Bytes(200'000), Bytes(100'000)}); });
  }
  duo.world.run_until(5s);
  const std::size_t answered = duo.done.size();
  EXPECT_EQ(duo.on_time(), static_cast<int>(answered));
  duo.world.at(6s, [&duo] { duo.round({Bytes(7'600'000), Bytes(1'000'000)}); });
  duo.cut(6s + 20ms, 0);
  duo.world.run_until(7s);
  ASSERT_EQ(duo.done.size(), answered + 1);
  EXPECT_EQ(duo.done.back().outcome, Outcome::kRemote);
  EXPECT_EQ(duo.delivered.back().second, 1) << "of the larger variant most was lost";
  EXPECT_EQ(duo.world.endpoint(duo.road).counters().reassembly_refused, 0U);
}

struct Return {
  const char* name;
  Duration absence;
  bool rebound;  // comes back with another address, as seen by the road
};

class ComesBack : public testing::TestWithParam<Return> {};

TEST_P(ComesBack, AndIsUsedWithinOneSecond) {
  const Return& p = GetParam();
  EchoDuo duo(pair_of(30, 50));
  const Duration gone = 3s + 4ms;
  const Duration back = gone + p.absence;
  duo.stream(1s, static_cast<int>((back + 3s) / 100ms), 100'000);
  Endpoint& vehicle = duo.world.endpoint(duo.vehicle);
  const LinkId a{0};
  duo.world.at(gone, [&] {
    vehicle.remove_link(duo.world.local_time(duo.vehicle), a);
    duo.world.faults(a).cut = true;
    duo.world.flush(duo.vehicle);
  });
  duo.world.at(back, [&] {
    if (p.rebound) duo.world.rebind(duo.vehicle, a);
    duo.world.faults(a).cut = false;
    vehicle.add_link(duo.world.local_time(duo.vehicle), a, {"a", 1500});
    EXPECT_TRUE(vehicle.add_path(duo.world.local_time(duo.vehicle), duo.peer, a,
                                 World::address_of(duo.road, a)));
    duo.world.flush(duo.vehicle);
  });
  duo.world.run_until(back + 2s);
  EXPECT_EQ(duo.when(duo.vehicle, 0, PathState::kDead, gone), gone);
  for (const HostId host : {duo.vehicle, duo.road}) {
    const auto ok = duo.when(host, 0, PathState::kOk, back);
    ASSERT_TRUE(ok) << host;
    EXPECT_LE(*ok - back, 1s) << host;
  }
  std::optional<Duration> used;
  for (const auto& [at, plan] : duo.planned) {
    const bool names_a =
        std::ranges::find(plan.plan.sends, a, &Assignment::link) != plan.plan.sends.end();
    if (at >= back && !used && names_a) used = at;
    EXPECT_FALSE(at >= gone && at < back && names_a);
  }
  ASSERT_TRUE(used);
  EXPECT_LE(*used - back, 1s);
  EXPECT_GE(duo.on_time(), static_cast<int>(duo.done.size()) - 1);
  std::printf("%s: used again %.0f ms after its return, %d of %zu rounds on time\n", p.name,
              to_ms(*used - back), duo.on_time(), duo.done.size());
}

INSTANTIATE_TEST_SUITE_P(Outage, ComesBack,
                         testing::Values(Return{"at_once", 150ms, false},
                                         Return{"same_address", 2s, false},
                                         Return{"rebound", 2s, true},
                                         Return{"after_long", 20s, false},
                                         Return{"rebound_after_long", 20s, true}),
                         [](const auto& p) { return std::string(p.param.name); });

// What comes after it has the other link to itself, which carried nothing for seconds.
TEST(Outage, OfTheFastestLinkBetweenTwoMessagesLosesNone) {
  for (int step = 0; step < 20; ++step) {
    Duo stream({constant_link("a", 30, 60, 60), constant_link("b", 60, 20, 20)}, {});
    stream.send(2s, 60);
    stream.world.at(7s + 22ms + step * 3'900us, [&stream] {
      World& world = stream.world;
      world.endpoint(stream.vehicle).remove_link(world.local_time(stream.vehicle), LinkId{0});
      world.faults(LinkId{0}).cut = true;
      world.flush(stream.vehicle);
    });
    stream.run();
    EXPECT_EQ(stream.missed(), 0U) << step;
  }
}

TEST(Outage, ANatThatForgetsTheMappingIsFollowed) {
  EchoDuo duo(pair_of(30, 50));
  duo.stream(1s, 50, 100'000);
  duo.world.at(3s + 4ms, [&] { duo.world.rebind(duo.vehicle, LinkId{0}); });
  duo.world.run_until(7s);
  EXPECT_EQ(duo.on_time(), 50);
  EXPECT_TRUE(duo.link(0).up);
  EXPECT_TRUE(duo.link(0, true).up);
}

// The way back of the faster link is silent for a second, and its way there is sound. The slower
// link carries only a part of each message, and alone would bring none in time; but the peer's
// feedback comes over it too, so nothing that the faster one carries is taken for lost.
TEST(Outage, OfTheWayBackAloneCostsTwoMessagesAtMost) {
  emu::LinkProfile first = constant_link("a", 30, 40, 40);
  // Down: 40 Mbit/s, and nothing at all in the fifth second.
  first.down.trace = std::make_shared<const emu::SteppedRate>(
      emu::SteppedRate{{{0s, DataRate::mbit(40)}, {4s, DataRate{}}, {5s, DataRate::mbit(40)}}, {}});
  Duo s({first, constant_link("b", 50, 5, 5)},
        {.policy = "stripe", .variants = {128 * 1024}, .deadline = 100ms});
  s.send(2s, 50);
  s.run();
  EXPECT_LE(s.missed(), 2U);
}

}  // namespace
}  // namespace interneuron::sim::outage_test
