#include "core/link/probe_schedule.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::link::probe_schedule_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

// Runs a prober alone on a path of `rate`; every train is measured 50 ms later.
struct Alone {
  ProbeSchedule prober;
  DataRate rate{};
  std::size_t heartbeats = 0;
  std::vector<std::pair<TimePoint, std::uint32_t>> trains;
  std::size_t proofs = 0;
  std::uint64_t train_bits = 0;
  TimePoint now = at(0s);
  std::size_t long_trains = 0;
  std::optional<TimePoint> report;

  void until(Duration end, Duration message_period = {}) {
    TimePoint message = now;
    while (now < at(end)) {
      if (message_period > 0ns && message <= now) {
        prober.data_sent(now);
        message += message_period;
      }
      if (prober.heartbeat_due(now)) {
        ++heartbeats;
        prober.heartbeat_sent(now);
      }
      if (const auto train = prober.train_due(now)) {
        trains.emplace_back(now, train->packets);
        train_bits += std::uint64_t{train->packets} * 1428 * 8;
        prober.train_sent(now, train->packets);
        if (rate.transmit_time((train->packets - 1) * 1428) >= 5ms) ++long_trains;
        report = now + 50ms;
      }
      if (prober.proof_due(now)) {
        ++proofs;
        prober.proof_sent(now);
      }
      if (report && *report <= now) {
        if (rate > DataRate{}) prober.train_told();
        if (rate > DataRate{}) prober.set_rate({rate, now, std::min<std::size_t>(long_trains, 3)});
        report.reset();
      }
      TimePoint next = prober.next_timeout(now);
      ASSERT_GT(next, now);
      if (report) next = std::min(next, *report);
      if (message_period > 0ns) next = std::min(next, message);
      now = std::min(next, at(end));
    }
  }
};

TEST(Prober, HeartbeatsFollowActivity) {
  Alone run;
  run.until(36s);
  EXPECT_NEAR(static_cast<double>(run.heartbeats), 600, 1) << "new";
  run.heartbeats = 0;
  run.until(66s);
  EXPECT_NEAR(static_cast<double>(run.heartbeats), 100, 1) << "idle";
  run.heartbeats = 0;
  run.until(96s, 100ms);
  EXPECT_NEAR(static_cast<double>(run.heartbeats), 600, 2);
  run.heartbeats = 0;
  run.until(126s);
  EXPECT_NEAR(static_cast<double>(run.heartbeats), 100 + 25.0 / 0.3, 3);  // 5 s more of activity
}

TEST(Prober, HeartbeatsKeepTheirBudgetWhateverTheirSize) {
  for (const std::size_t bytes : {152U, 228U, 684U, 1400U}) {
    Alone run;
    run.prober.set_sizes(bytes, 1428);
    run.until(60s, 100ms);
    EXPECT_LE(static_cast<double>(run.heartbeats * bytes * 8) / 60, 30'000 * 1.01) << bytes;
  }
}

TEST(Prober, HeartbeatsLeaveASlowPathToMessages) {
  for (const double mbit : {0.02, 0.1, 0.5, 1.0, 1.5, 100.0}) {
    Alone run;
    run.prober.set_sizes(186, 1428);
    run.prober.set_slower(DataRate::mbit(mbit));
    run.until(60s, 100ms);
    const double kbit = static_cast<double>(run.heartbeats * 186 * 8) / 60 / 1000;
    EXPECT_LE(kbit, std::max(5.1, 20.5 * mbit)) << mbit;
    EXPECT_GE(kbit, std::min(28.0, std::max(4.9, 19.5 * mbit))) << mbit;
  }
}

// An idle path may cost 30 kbit/s, and the feedback on the other side's trains is not planned with.
TEST(Prober, HeartbeatsOfAnIdlePathLeaveRoomForFeedback) {
  Alone run;
  run.prober.set_sizes(186, 1428);
  run.until(30s);
  EXPECT_LE(static_cast<double>(run.heartbeats * 186 * 8) / 30, 25'000);
}

TEST(Prober, AMeteredPathIsKeptOpenWithFewHeartbeatsAndNoTrains) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.prober.set_metered(true);
  run.prober.set_ready(true);
  run.until(120s);
  EXPECT_LE(run.heartbeats, 11U);
  EXPECT_GE(run.heartbeats, 8U);  // <= 15 s apart
  EXPECT_TRUE(run.trains.empty());
  run.prober.request_train(run.now);
  run.until(121s);
  EXPECT_EQ(run.trains.size(), 1U);
}

TEST(Prober, LooksForAMeteredPeerAtTheUsualPace) {
  Alone run;
  run.prober.set_metered(true);
  run.until(30s);
  EXPECT_NEAR(static_cast<double>(run.heartbeats), 100, 1);
}

TEST(Prober, TrainsAreLongEnoughAndKeepTheBudget) {
  for (const double mbit : {0.5, 5.0, 20.0, 100.0, 500.0, 1000.0}) {
    Alone run;
    run.rate = DataRate::mbit(mbit);
    run.prober.set_ready(true);
    run.until(300s);
    ASSERT_GE(run.trains.size(), 3U) << mbit;
    const double mean = static_cast<double>(run.train_bits) / 300;
    EXPECT_LE(mean, 150'000 + 2e6 / 300) << mbit;  // with the start-up budget
    const std::uint32_t last = run.trains.back().second;
    EXPECT_GE(last, 3U);
    EXPECT_LE(run.rate.transmit_time(last * 1428), mbit < 1 ? 120ms : 50ms) << mbit;
    EXPECT_GE(to_ms(run.rate.transmit_time((last - 1) * 1428)), 10 * 0.99) << mbit;
    // Three trains settle it soon where the budget allows, then one per 10 s.
    if (mbit <= 20) {
      EXPECT_LT(run.trains[2].first, at(5s)) << mbit;
      EXPECT_GE(run.trains[4].first - run.trains[3].first, 10s) << mbit;
    }
  }
}

TEST(Prober, TheFirstTrainsGrowUntilTheyAreLongEnough) {
  Alone run;
  run.rate = DataRate::mbit(100);
  run.prober.set_ready(true);
  run.until(1s);
  ASSERT_GE(run.trains.size(), 2U);
  EXPECT_EQ(run.trains[0].second, 32U);
  EXPECT_GE(run.trains[1].second, 64U);
}

TEST(Prober, AGuessOnlyDoublesTheNextTrain) {
  ProbeSchedule p;
  p.set_ready(true);
  p.active(TimePoint{});
  p.train_sent(TimePoint{}, 32);
  p.set_rate({DataRate::mbit(3'900), std::nullopt, 0});
  EXPECT_FALSE(p.train_due(TimePoint{3'900ms})) << "it is still on its way";
  p.train_told();
  const auto train = p.train_due(TimePoint{300ms});
  ASSERT_TRUE(train);
  EXPECT_EQ(train->packets, 64U);
}

TEST(Prober, NothingIsProbedWhileMessagesMeasure) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.prober.set_ready(true);
  for (Duration t = 1s; t <= 120s; t += 1s) {
    run.prober.set_rate({run.rate, run.now, 3});
    run.until(t, 100ms);
  }
  EXPECT_TRUE(run.trains.empty());
}

// Messages of one packet never do.
TEST(Prober, OldEvidenceIsRefreshedInThePausesOfMessages) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.prober.set_ready(true);
  run.prober.set_rate({run.rate, run.now, 3});
  run.until(90s, 100ms);
  EXPECT_GE(run.trains.size(), 8U);
  EXPECT_LE(run.trains.size(), 10U);
}

// Messages that come faster than any pause would hide the rate of the link for ever.
TEST(Prober, OrAmongThemAfterASecondWithoutAPause) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.prober.set_ready(true);
  run.until(999ms, 10ms);
  EXPECT_TRUE(run.trains.empty());
  run.until(1'010ms, 10ms);
  EXPECT_EQ(run.trains.size(), 1U);
}

TEST(Prober, APathInUseThatCarriesFarMoreThanIsNeededGetsNoTrains) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.prober.set_ready(true);
  run.prober.set_rate({run.rate, run.now, 1});
  run.prober.set_needed(DataRate::mbit(5));
  run.until(60s, 100ms);
  EXPECT_TRUE(run.trains.empty());
  run.prober.request_train(run.now);
  run.until(61s, 100ms);
  EXPECT_EQ(run.trains.size(), 1U);
  // Nobody uses it any more.
  run.until(90s);
  EXPECT_GE(run.trains.size(), 3U);
}

TEST(Prober, ItGetsThemWhereMoreWouldHelpOrNothingIsKnown) {
  Alone slow;
  slow.rate = DataRate::mbit(19);
  slow.prober.set_ready(true);
  slow.prober.set_rate({slow.rate, slow.now, 1});
  slow.prober.set_needed(DataRate::mbit(5));
  slow.until(60s, 100ms);
  EXPECT_GE(slow.trains.size(), 4U);
  Alone guess;
  guess.rate = DataRate::mbit(20);
  guess.prober.set_ready(true);
  guess.prober.set_rate({guess.rate, std::nullopt, 0});
  guess.prober.set_needed(DataRate::mbit(5));
  guess.until(1s, 100ms);
  EXPECT_FALSE(guess.trains.empty());
}

// --- wanted trains

// Every 100 ms a message is withheld for want of `wanted`, of a path of `rate`.
struct Wanted {
  Alone run;
  DataRate wanted;
  explicit Wanted(double rate, double want) : wanted(DataRate::mbit(want)) {
    run.rate = DataRate::mbit(rate);
    run.long_trains = 3;
    run.prober.set_ready(true);
    run.prober.set_rate({run.rate, run.now, 3});
    run.prober.data_sent(run.now);
  }
  void until(Duration end) {
    for (Duration t = run.now.time_since_epoch(); t < end; t += 100ms) {
      run.prober.want(run.now, wanted);
      run.until(t + 100ms, 100ms);
    }
  }
};

TEST(Prober, AWithheldVariantIsTriedForSoonAndWithFewBytes) {
  for (const double mbit : {1.0, 2.0, 6.0, 18.0}) {
    Wanted w(mbit, mbit * 5);
    w.until(3s);
    EXPECT_GE(w.run.trains.size(), 3U) << mbit;
    EXPECT_LE(static_cast<double>(w.run.train_bits), (0.05 * 3 + 0.05) * mbit * 1e6) << mbit;
  }
}

TEST(Prober, ATrainIsPacedByWhatIsWanted) {
  for (const auto& [wanted, pace] : {std::pair{7.0, 8.75}, {100.0, 18.0}, {6.1, 7.625}}) {
    ProbeSchedule p;
    p.set_ready(true);
    p.set_rate({DataRate::mbit(6), at(0s), 3});
    p.want(at(1s), DataRate::mbit(wanted));
    const auto train = p.train_due(at(1s));
    ASSERT_TRUE(train && train->pace);
    EXPECT_NEAR(train->pace->mbit(), pace, 1e-6) << wanted;
    EXPECT_GE(train->pace->transmit_time((train->packets - 1) * 1428), 5ms);
  }
}

TEST(Prober, NothingIsTriedForThatIsNotWantedOrThere) {
  Wanted there(60, 20);
  there.until(5s);
  EXPECT_TRUE(there.run.trains.empty());
  Wanted metered(6, 20);
  metered.run.prober.set_metered(true);
  metered.until(5s);
  EXPECT_TRUE(metered.run.trains.empty());
}

TEST(Prober, WantedTrainsThatFindNothingBecomeRare) {
  Wanted w(6, 60);
  w.until(60s);
  w.run.trains.clear();
  w.until(160s);
  EXPECT_LE(w.run.trains.size(), 20U) << "as the usual ones, every 10 s";
  // A real change ends that.
  w.run.rate = DataRate::mbit(12);
  w.until(172s);
  w.run.trains.clear();
  w.until(177s);
  EXPECT_GE(w.run.trains.size(), 10U);
}

// Whatever a peer reports and whatever is wanted, probes stay within the budgets.
RC_GTEST_PROP(Prober, NoReportsDrawMoreThanTheBudgets, ()) {
  ProbeSchedule p;
  p.set_ready(true);
  TimePoint now = at(0s);
  double sent = 0;
  const int steps = *rc::gen::inRange(100, 2'000);
  for (int i = 0; i < steps; ++i) {
    const int what = *rc::gen::inRange(0, 6);
    if (what == 0) p.want(now, DataRate{*rc::gen::inRange<std::int64_t>(1, 5'000'000'000'000)});
    if (what == 1) p.data_sent(now);
    if (what == 2 || what == 3) {
      const std::int64_t rate = *rc::gen::element<std::int64_t>(1, 1'000, 100'000, 9'000'000,
                                                                1'000'000'000, 4'000'000'000'000);
      const std::size_t trains = *rc::gen::inRange<std::size_t>(0, 4);
      std::optional<TimePoint> when;
      if (*rc::gen::arbitrary<bool>()) when = now;
      p.set_rate({DataRate{rate}, when, trains});
    }
    if (what == 4) p.request_train(now);
    while (const auto train = p.train_due(now)) {
      RC_ASSERT(train->packets <= 1'000U);
      RC_ASSERT(train->packets >= 2U);
      sent += 8.0 * 1428 * train->packets;
      p.train_sent(now, train->packets);
    }
    const double seconds = static_cast<double>(now.time_since_epoch().count()) / 1e9;
    // The start budget, and the last train of each kind, which is paid for afterwards.
    const double allowed = 2e6 + 2 * 8.0 * 1428 * 1'000;
    RC_ASSERT(sent <= allowed + (145e3 + 1e6) * seconds);
    RC_ASSERT(p.next_timeout(now) >= now);
    now += *rc::gen::element<Duration>(1ms, 10ms, 30ms, 100ms, 300ms);
  }
}

TEST(Prober, NothingIsProbedBeforeThePathIsReady) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.until(30s);
  EXPECT_TRUE(run.trains.empty());
}

TEST(Prober, ATrainThatVanishedIsTriedAgainWithinTheBudget) {
  Alone run;  // rate 0: nothing comes back
  run.prober.set_ready(true);
  run.until(60s);
  EXPECT_GE(run.trains.size(), 14U);  // one in 4 s
  EXPECT_LE(static_cast<double>(run.train_bits) / 60, 150'000 + 2e6 / 60);
}

TEST(Prober, OnDemandAtOnce) {
  Alone run;
  run.rate = DataRate::mbit(20);
  run.prober.set_ready(true);
  run.until(30s);
  const std::size_t before = run.trains.size();
  run.prober.request_train(run.now);
  run.until(30s + 10ms);
  EXPECT_EQ(run.trains.size(), before + 1);
}

TEST(Prober, ALatchedPathGetsProofsNotTrains) {
  Alone run;
  run.prober.set_ready(true);
  run.prober.set_latched(true);
  run.until(10s);
  EXPECT_TRUE(run.trains.empty());
  EXPECT_NEAR(static_cast<double>(run.proofs), 40, 1);
}

}  // namespace
}  // namespace interneuron::link::probe_schedule_test
