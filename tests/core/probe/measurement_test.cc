#include "core/probe/measurement.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "tests/core/probe/virtual_path.h"

namespace interneuron::probe::measurement_test {
namespace {

std::size_t accounted(const Summary& s) {
  return s.answered + s.late + s.lost_up + s.lost_down + s.lost;
}

TEST(ProbeSession, MeasuresAPathThatIsAsItIs) {
  for (const Format format : {Format::kEcho, Format::kStamp}) {
    VirtualPath path(options_of(format), {.delay = 12ms}, {.delay = 8ms});
    path.run();
    const Summary s = path.session.summary();
    EXPECT_EQ(s.sent, 200U);
    EXPECT_EQ(s.answered, 200U);
    EXPECT_NEAR(to_ms(s.rtt.min), 20, 1e-3);
    EXPECT_NEAR(to_ms(s.rtt.p50), 20, 1e-3);
    EXPECT_NEAR(to_ms(s.rtt.max), 20, 1e-3);
    EXPECT_NEAR(to_ms(s.variation_up.max), 0, 1e-3);
    EXPECT_NEAR(to_ms(s.variation_down.max), 0, 1e-3);
    EXPECT_EQ(s.loss(), 0);
    EXPECT_EQ(path.replies.size(), 200U);
    EXPECT_EQ(path.session.log().size(), 200U) << "nothing is sent that is not needed";
  }
}

TEST(ProbeSession, KeepsTheIntervalExactly) {
  Options options = options_of(Format::kEcho, 20'000);
  options.interval = 1ms;
  VirtualPath path(options, {}, {});
  path.run();
  const PacketLog& log = path.session.log();
  ASSERT_EQ(log.size(), 20'000U);
  for (std::size_t i = 0; i < log.size(); ++i) ASSERT_EQ(log[i].sent, TimePoint{1s} + i * 1ms);
}

TEST(ProbeSession, SendsWhatItMissedButNotAfterALongPause) {
  Options options = options_of(Format::kEcho, 1000);
  options.interval = 1ms;
  Measurement session(options, TimePoint{1s});
  std::array<std::byte, 2000> buffer;
  const auto drain = [&](TimePoint now) {
    std::size_t count = 0;
    while (session.poll(now, buffer) > 0) ++count;
    return count;
  };
  EXPECT_EQ(drain(TimePoint{1s}), 1U);
  EXPECT_EQ(drain(TimePoint{1s + 30ms}), 30U);
  EXPECT_EQ(drain(TimePoint{3s}), 1U);
  EXPECT_EQ(session.next_timeout(), TimePoint{3s + 1ms});
}

TEST(ProbeSession, TellsLossThereFromLossBack) {
  const auto every = [](std::size_t k) { return [k](std::size_t n) { return n % k == k - 1; }; };
  VirtualPath path(options_of(), {.lose = every(10)}, {.lose = every(9)});
  path.run();
  const Summary s = path.session.summary();
  EXPECT_TRUE(s.stateful);
  EXPECT_EQ(s.lost_up, path.truth.lost_up);
  EXPECT_EQ(s.lost_down, path.truth.lost_down);
  EXPECT_EQ(s.lost, 0U);
  EXPECT_EQ(s.lost_up, 20U);
  EXPECT_EQ(s.longest_burst, 2U);
  EXPECT_EQ(accounted(s), s.sent);
}

TEST(ProbeSession, TheLastOnesAreToldApartToo) {
  for (const bool there : {true, false}) {
    const auto tail = [](std::size_t n) { return n >= 190 && n < 200; };
    VirtualPath path(options_of(), there ? Way{.lose = tail} : Way{},
                     there ? Way{} : Way{.lose = tail});
    path.run();
    const Summary s = path.session.summary();
    EXPECT_EQ(s.lost_up, there ? 10U : 0U);
    EXPECT_EQ(s.lost_down, there ? 0U : 10U);
    EXPECT_EQ(s.lost, 0U);
    EXPECT_EQ(s.longest_burst, 10U);
    EXPECT_EQ(s.bursts, 1U);
  }
}

TEST(ProbeSession, AStampReflectorThatCountsTellsTheDirectionAndOneThatDoesNotDoesNot) {
  const Way lossy{.loss = 0.1};
  VirtualPath counts(options_of(Format::kStamp), lossy, lossy, 5, Reflector::kStateful);
  counts.run();
  const Summary stateful = counts.session.summary();
  EXPECT_TRUE(stateful.stateful);
  EXPECT_EQ(stateful.lost_up, counts.truth.lost_up);
  EXPECT_EQ(stateful.lost_down, counts.truth.lost_down);

  VirtualPath repeats(options_of(Format::kStamp), lossy, lossy, 5, Reflector::kStateless);
  repeats.run();
  const Summary stateless = repeats.session.summary();
  EXPECT_FALSE(stateless.stateful);
  EXPECT_EQ(stateless.lost_up + stateless.lost_down, 0U);
  EXPECT_EQ(stateless.lost, repeats.truth.lost_up + repeats.truth.lost_down);
}

TEST(ProbeSession, NothingComesBack) {
  VirtualPath path(options_of(), {.loss = 1}, {});
  path.run();
  const Summary s = path.session.summary();
  EXPECT_TRUE(path.session.done());
  EXPECT_EQ(s.lost, 200U);
  EXPECT_EQ(s.rtt.samples, 0U);
  EXPECT_EQ(path.session.log().size(), 200U);
}

TEST(ProbeSession, LateRepliesAreLateNotLost) {
  Options options = options_of();
  options.timeout = 40ms;
  const auto delayed = Way{.overtaken = 0.1, .later = 100ms};
  VirtualPath path(options, delayed, {});
  path.run();
  const Summary s = path.session.summary();
  EXPECT_GT(s.late, 5U);
  EXPECT_EQ(accounted(s), s.sent);
  EXPECT_EQ(s.lost_up + s.lost_down, 0U);
  EXPECT_LE(s.lost, 10U) << "only those that were under way at the end";
}

TEST(ProbeSession, DuplicatesAndReorderingAreCounted) {
  VirtualPath path(options_of(Format::kEcho, 2000), {.duplicates = 0.05},
                   {.duplicates = 0.05, .overtaken = 0.1});
  path.run();
  const Summary s = path.session.summary();
  EXPECT_EQ(s.answered, 2000U);
  EXPECT_EQ(accounted(s), s.sent);
  EXPECT_NEAR(static_cast<double>(s.duplicates), 200, 60);
  EXPECT_NEAR(s.reordered_ratio(), 0.1, 0.03);
}

TEST(ProbeSession, TheOffsetOfTheClocksIsInNothing) {
  for (const Duration offset : {Duration{0}, Duration{30'000h}, Duration{5ms}}) {
    VirtualPath path(options_of(), {.delay = 12ms, .overtaken = 0.2, .later = 5ms}, {});
    path.offset = offset;
    path.run();
    const Summary s = path.session.summary();
    EXPECT_NEAR(to_ms(s.rtt.min), 22, 1e-3);
    EXPECT_NEAR(to_ms(s.variation_up.max), 5, 1e-3);
    EXPECT_NEAR(to_ms(s.variation_down.max), 0, 1e-3);
  }
}

TEST(ProbeSession, ClocksThatDriftApartAreNotTakenForQueues) {
  Options options = options_of(Format::kEcho, 6000);  // two minutes
  VirtualPath path(options, {.overtaken = 0.05, .later = 8ms}, {});
  path.drift = 50e-6;  // 6 ms in all
  path.run();
  const Summary s = path.session.summary();
  EXPECT_NEAR(to_ms(s.variation_up.max), 8, 0.8);
  EXPECT_LT(to_ms(s.variation_up.p50), 0.8);
  EXPECT_LT(to_ms(s.variation_down.max), 0.8);
}

TEST(ProbeSession, TheReflectorsOwnTimeIsNotTheNetworks) {
  VirtualPath path(options_of(Format::kStamp), {}, {});
  path.turnaround = 300us;  // stamped, though the virtual reflector takes none
  path.run();
  EXPECT_NEAR(to_ms(path.session.summary().rtt.p50), 20 - 0.3, 1e-3);
}

// --- rates

TEST(ProbeSession, MeasuresTheRateOfBothWays) {
  for (const double mbit : {1.0, 5.0, 30.0, 100.0, 400.0}) {
    VirtualPath path(options_of(Format::kEcho, 50, true), {.rate = DataRate::mbit(mbit)},
                     {.rate = DataRate::mbit(mbit / 2)});
    path.run();
    const Summary s = path.session.summary();
    ASSERT_TRUE(s.rate_up && s.rate_down) << mbit;
    EXPECT_NEAR(s.rate_up->mbit(), mbit, 0.02 * mbit);
    EXPECT_NEAR(s.rate_down->mbit(), mbit / 2, 0.02 * mbit);
    EXPECT_EQ(s.answered, 50U);
    EXPECT_LT(to_ms(s.rtt.max), 20 + 8 * 1.5 * 8 / mbit) << "no ping waits behind a train";
  }
}

TEST(ProbeSession, PlainStampMeasuresTheRateThere) {
  VirtualPath path(options_of(Format::kStamp, 50, true), {.rate = DataRate::mbit(30)}, {});
  path.run();
  const Summary s = path.session.summary();
  ASSERT_TRUE(s.rate_up);
  EXPECT_NEAR(s.rate_up->mbit(), 30, 0.6);
  EXPECT_FALSE(s.rate_down);
}

TEST(ProbeSession, ALossyPathHasARateToo) {
  VirtualPath path(options_of(Format::kEcho, 200, true), {.rate = DataRate::mbit(20), .loss = 0.05},
                   {.rate = DataRate::mbit(40), .loss = 0.05}, 7);
  path.run();
  const Summary s = path.session.summary();
  ASSERT_TRUE(s.rate_up && s.rate_down);
  EXPECT_NEAR(s.rate_up->mbit(), 20, 3);
  EXPECT_NEAR(s.rate_down->mbit(), 40, 6);
  EXPECT_EQ(s.lost_up, path.truth.lost_up);
  EXPECT_EQ(s.lost_down, path.truth.lost_down);
}

TEST(ProbeSession, NoTrainBeforeThePathIsKnownToAnswer) {
  VirtualPath path(options_of(Format::kEcho, 50, true), {.loss = 1}, {});
  path.run();
  EXPECT_EQ(path.session.summary().train_packets, 0U);
}

// --- the end

TEST(ProbeSession, StoppedItWaitsForWhatIsUnderWay) {
  for (const auto at : {Duration{500ms}, Duration{120ms}}) {
    VirtualPath path(options_of(Format::kEcho, 1000, true), {.rate = DataRate::mbit(5)}, {});
    bool stopped = false;
    path.on_step = [&](VirtualPath& p) {
      if (!stopped && p.now() > TimePoint{1s + at}) {
        stopped = true;
        p.session.stop(p.now());
      }
    };
    path.run();
    EXPECT_TRUE(path.session.done());
    EXPECT_LT(path.now(), TimePoint{1s + at + 1100ms});
    const Summary s = path.session.summary();
    EXPECT_LT(s.sent, 100U);
    EXPECT_EQ(s.answered, s.sent);
  }
}

TEST(ProbeSession, WhatIsNoReplyOfOursIsCountedAndIgnored) {
  Measurement session(options_of(Format::kStamp), TimePoint{1s});
  std::array<std::byte, 2000> buffer;
  ASSERT_GT(session.poll(TimePoint{1s}, buffer), 0U);
  const auto answer = [&](std::uint32_t sequence, Duration sent) {
    wire::StampReply reply =
        wire::stamp_reply_to({sequence, wire::to_stamp_time(sent), wire::kStampUnsynchronised}, 64);
    Bytes out(wire::kStampBytes);
    wire::write_stamp_reply(out, reply, {});
    return out;
  };
  EXPECT_FALSE(session.handle(TimePoint{1s + 1ms}, Bytes(3)));
  EXPECT_FALSE(session.handle(TimePoint{1s + 1ms}, answer(1, 1000h + 1s)));  // never sent
  EXPECT_FALSE(session.handle(TimePoint{1s + 1ms}, answer(0, 1000h + 2s)));  // not then
  EXPECT_EQ(session.foreign(), 3U);
  EXPECT_TRUE(session.handle(TimePoint{1s + 1ms}, answer(0, 1000h + 1s)));
}

RC_GTEST_PROP(ProbeSessionProperty, EveryPingHasOneFateAndTheDirectionsAreExact, ()) {
  const auto percent = [](int most) { return *rc::gen::inRange(0, most + 1) / 100.0; };
  const Way up{.delay = *rc::gen::inRange(1, 100) * 1ms, .loss = percent(20)};
  const Way down{.delay = *rc::gen::inRange(1, 100) * 1ms, .loss = percent(20)};
  Options options = options_of(Format::kEcho, *rc::gen::inRange<std::size_t>(1, 300),
                               *rc::gen::arbitrary<bool>());
  options.interval = *rc::gen::inRange(1, 50) * 1ms;
  VirtualPath path(options, up, down, *rc::gen::arbitrary<std::uint64_t>());
  path.run();
  RC_ASSERT(path.session.done());
  const Summary s = path.session.summary();
  RC_ASSERT(s.sent == options.count);
  RC_ASSERT(accounted(s) == s.sent);
  RC_ASSERT(s.all_lost() == path.truth.lost_up + path.truth.lost_down);
  // Between two answers the two directions are told apart by number, not one by one: exact but for
  // what was lost beside the pings (trains, closing packets).
  const auto others =
      static_cast<std::size_t>(std::ranges::count_if(path.session.log(), [](const SentPacket& p) {
        return !p.answered && p.purpose != Purpose::kPing && p.purpose != Purpose::kSkipped;
      }));
  const auto apart = [](std::size_t a, std::size_t b) { return a > b ? a - b : b - a; };
  RC_ASSERT(apart(s.lost_up, path.truth.lost_up) <= others + s.lost);
  RC_ASSERT(apart(s.lost_down, path.truth.lost_down) <= others + s.lost);
}

RC_GTEST_PROP(ProbeSessionProperty, WithDuplicatesAndReorderingEveryPingStillHasOneFate, ()) {
  const auto some = [] {
    const auto percent = [](int most) { return *rc::gen::inRange(0, most + 1) / 100.0; };
    return Way{.rate = DataRate::mbit(*rc::gen::inRange(0, 50)),
               .loss = percent(30),
               .duplicates = percent(30),
               .overtaken = percent(30)};
  };
  Options options = options_of(*rc::gen::element(Format::kEcho, Format::kStamp),
                               *rc::gen::inRange<std::size_t>(1, 300), *rc::gen::arbitrary<bool>());
  options.timeout = *rc::gen::inRange(10, 1000) * 1ms;
  const Way up = some();
  const Way down = some();
  VirtualPath path(options, up, down, *rc::gen::arbitrary<std::uint64_t>(),
                   *rc::gen::element(Reflector::kStateful, Reflector::kStateless));
  path.run();
  RC_ASSERT(path.session.done());
  const Summary s = path.session.summary();
  RC_ASSERT(s.sent == options.count);
  RC_ASSERT(accounted(s) == s.sent);
}

}  // namespace
}  // namespace interneuron::probe::measurement_test
