#include "core/flow/sent_packets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "sender_support.h"

namespace interneuron::flow::sent_packets_test {
namespace {

constexpr std::size_t kFull = 1428;
constexpr SentPackets::Silence kSilence{100ms, 50ms};

SentPackets::Piece piece(std::uint16_t index) { return {MessageId{1}, index}; }

// What was sent, and reports about it.
struct Record {
  SentPackets sent;
  std::set<std::uint64_t> arrived;
  std::uint16_t pieces = 0;

  // A message of `packets`, `step` apart.
  TimePoint message(TimePoint now, std::uint32_t packets, Duration step) {
    for (std::uint32_t i = 0; i < packets; ++i, now += step) {
      const bool more = i + 1 < packets;
      arrived.insert(sent.add(now, kFull, more, piece(pieces++)));
    }
    return now;
  }
  std::optional<link::Train> train(TimePoint now, std::uint64_t start, std::uint32_t packets,
                                   DataRate rate) {
    wire::LinkReport r = report_of(kA, arrived);
    r.train_start = start;
    r.train_packets = packets;
    r.train_rate = rate;
    return sent.report(now, r, 10ms, kSilence).train;
  }
};

TEST(SentPackets, ATrainIsToldWithTheRateThatItWasSentAt) {
  Record r;
  const TimePoint now = r.message(at(0s), 40, 100us);
  EXPECT_FALSE(r.train(now, 0, 0, {}));
  const auto train = r.train(now, 11, 30, DataRate::mbit(20));
  ASSERT_TRUE(train && train->sent_at);
  EXPECT_EQ(train->id, 11U);
  EXPECT_EQ(train->packets, 30U);
  EXPECT_EQ(train->left, 30U);
  EXPECT_EQ(train->bytes, 29 * kFull);
  EXPECT_EQ(train->measured, DataRate::mbit(20));
  EXPECT_NEAR(train->sent_at->mbit(), kFull * 8.0 / 100, 0.1);
  EXPECT_EQ(train->pause, 0ns);
}

// A train is trusted by its length: the peer cannot make one longer than what was sent.
TEST(SentPackets, ATrainIsNoLongerThanWhatLeft) {
  Record r;
  const TimePoint now = r.message(at(0s), 20, 100us);
  const auto train = r.train(now, 1, UINT32_MAX, DataRate{std::int64_t{UINT32_MAX} * 1000});
  ASSERT_TRUE(train);
  EXPECT_EQ(train->packets, 20U);
  EXPECT_EQ(train->bytes, 19 * kFull);
}

TEST(SentPackets, ATrainTellsHowLongNothingWasThereToSend) {
  Record r;
  TimePoint now = r.message(at(0s), 10, 1ms);
  now = r.message(now + 20ms, 5, 1ms);
  EXPECT_EQ(r.train(now, 1, 15, DataRate::mbit(5))->pause, 21ms);
  EXPECT_EQ(r.train(now, 11, 5, DataRate::mbit(5))->pause, 0ns);
  // The same train has grown.
  EXPECT_EQ(r.train(now, 1, 15, DataRate::mbit(5))->pause, 21ms);
  now = r.message(now + 40ms, 5, 1ms);
  EXPECT_EQ(r.train(now, 1, 20, DataRate::mbit(5))->pause, 41ms);
}

// Probes leave at their pace although nothing waits behind them.
TEST(SentPackets, ProbesOfATrainDoNotPause) {
  Record r;
  TimePoint now = at(0s);
  for (int i = 0; i < 6; ++i, now += 19ms)
    r.arrived.insert(r.sent.add(now, kFull, false, std::nullopt));
  EXPECT_EQ(r.train(now, 1, 6, DataRate::mbit(0.6))->pause, 0ns);
  now += 231ms;  // single probes that prove delivery
  r.arrived.insert(r.sent.add(now, kFull, false, std::nullopt));
  EXPECT_EQ(r.train(now, 1, 7, DataRate::mbit(0.6))->pause, 250ms);
}

// --- what is lost, with a round trip of 30 ms

// A report of all packets that have arrived by now; how many fragments it settles as lost.
std::size_t lost_by(SentPackets& sent, TimePoint now, const std::set<std::uint64_t>& arrived) {
  const auto verdicts = sent.report(now, report_of(kA, arrived), 30ms, kSilence);
  return static_cast<std::size_t>(
      std::ranges::count_if(verdicts.pieces, [](const auto& s) { return !s.arrived; }));
}

std::set<std::uint64_t> all_but(std::uint64_t last, const std::set<std::uint64_t>& missing) {
  std::set<std::uint64_t> out;
  for (std::uint64_t n = 1; n <= last; ++n) {
    if (!missing.contains(n)) out.insert(n);
  }
  return out;
}

TEST(SentPackets, ThreeLaterArrivalsAreALossWhileNothingIsReordered) {
  Record r;
  r.message(at(0s), 10, 1ms);
  EXPECT_EQ(lost_by(r.sent, at(37ms), all_but(7, {5})), 0U);
  EXPECT_EQ(lost_by(r.sent, at(38ms), all_but(8, {5})), 1U);
}

// The last but one of a message: nothing follows that would tell.
TEST(SentPackets, OneLaterArrivalIsALossAQuarterRoundTripOn) {
  Record r;
  r.message(at(0s), 10, 1ms);
  EXPECT_EQ(lost_by(r.sent, at(39ms), all_but(10, {9})), 0U);
  const TimePoint overdue = at(8ms + 30ms + 7500us);
  EXPECT_EQ(r.sent.silent_at(kSilence), overdue);
  EXPECT_TRUE(r.sent.settle_silent(overdue - 1ns, kSilence).empty());
  EXPECT_EQ(r.sent.settle_silent(overdue, kSilence).size(), 1U);
  EXPECT_FALSE(r.sent.silent_at(kSilence));
}

TEST(SentPackets, WhatIsOvertakenIsWaitedFor) {
  Record r;
  r.message(at(0s), 20, 1ms);
  EXPECT_EQ(lost_by(r.sent, at(40ms), all_but(10, {5})), 1U);
  // It comes 11 ms after its turn; the next one that is late is given a quarter more.
  EXPECT_EQ(lost_by(r.sent, at(46ms), all_but(16, {})), 0U);
  EXPECT_EQ(lost_by(r.sent, at(49ms), all_but(20, {18})), 0U);
  EXPECT_TRUE(r.sent.settle_silent(at(60ms), kSilence).empty());
  EXPECT_EQ(r.sent.settle_silent(at(61ms), kSilence).size(), 1U);
}

TEST(SentPackets, ReorderingIsForgottenAfterRealLosses) {
  Record r;
  r.message(at(0s), 100, 1ms);
  EXPECT_EQ(lost_by(r.sent, at(40ms), all_but(10, {5})), 1U);
  EXPECT_EQ(lost_by(r.sent, at(46ms), all_but(16, {})), 0U);
  std::set<std::uint64_t> missing;
  for (std::uint64_t n = 20; n < 60; n += 2) missing.insert(n);
  EXPECT_GE(lost_by(r.sent, at(100ms), all_but(70, missing)), 16U);
  missing.insert(75);
  EXPECT_EQ(lost_by(r.sent, at(108ms), all_but(78, missing)), 1U) << "by three later ones";
}

// Five percent of the packets come up to 10 ms late.
TEST(SentPackets, ReorderingCostsFewSecondCopies) {
  Record r;
  std::mt19937_64 rng(1);
  std::multimap<TimePoint, std::uint64_t> coming;
  std::set<std::uint64_t> arrived;
  std::size_t lost = 0;
  std::uint64_t sent = 0;
  for (TimePoint now = at(0s); now < at(20s); now += 200us) {
    const bool burst = now.time_since_epoch() % 100ms < 18ms;
    if (burst) {
      const std::uint64_t n = r.sent.add(now, kFull, true, piece(static_cast<std::uint16_t>(sent)));
      const Duration late = rng() % 20 == 0 ? Duration{rng() % 10'000'000} : Duration{};
      coming.emplace(now + 15ms + late, n);
      ++sent;
    }
    while (!coming.empty() && coming.begin()->first <= now) {
      arrived.insert(coming.begin()->second);
      coming.erase(coming.begin());
    }
    lost += r.sent.settle_silent(now, kSilence).size();
    if (!arrived.empty() && now.time_since_epoch() % 2ms == 0ns) {
      const auto first =
          arrived.lower_bound(*arrived.rbegin() - std::min<std::uint64_t>(*arrived.rbegin(), 256));
      lost += lost_by(r.sent, now, std::set(first, arrived.end()));
    }
  }
  EXPECT_GT(sent, 15'000U);
  EXPECT_LT(static_cast<double>(lost) / static_cast<double>(sent), 0.005);
}

// --- what counts as the path's loss

TEST(SentPackets, WhatIsLostInSilenceCountsOnceTheReportsWouldTellOfIt) {
  Record r;
  r.message(at(0s), 20, 1ms);
  lost_by(r.sent, at(40ms), all_but(10, {}));
  EXPECT_EQ(r.sent.settle_silent(at(300ms), kSilence).size(), 10U);
  auto runs = r.sent.report(at(500ms), report_of(kA, all_but(10, {})), 30ms, kSilence).runs;
  EXPECT_TRUE(runs.empty()) << "a stall of the radio";
  runs = r.sent.report(at(1100ms), report_of(kA, all_but(10, {})), 30ms, kSilence).runs;
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_FALSE(runs[0].arrived);
  EXPECT_EQ(runs[0].packets, 10U);
}

TEST(SentPackets, LostReportsAreNoLossOfThePath) {
  Record r;
  r.message(at(0s), 20, 1ms);
  EXPECT_EQ(r.sent.settle_silent(at(300ms), kSilence).size(), 20U);
  const auto runs = r.sent.report(at(2s), report_of(kA, all_but(20, {})), 30ms, kSilence).runs;
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_TRUE(runs[0].arrived);
}

// It was overtaken, and what tells of its arrival is late as well: whoever waits for the fragment
// wants to know nevertheless.
TEST(SentPackets, AFragmentThatArrivesAfterItsLossWasCertainIsToldOf) {
  Record r;
  r.message(at(0s), 3, 1ms);
  r.arrived.erase(2);
  for (const Duration now : {20ms, 500ms}) {
    for (const auto& p : r.sent.report(at(now), report_of(kA, r.arrived), 10ms, kSilence).pieces) {
      EXPECT_NE(p.arrived, p.piece == piece(1));
    }
  }
  r.arrived.insert(2);
  const auto verdicts = r.sent.report(at(600ms), report_of(kA, r.arrived), 10ms, kSilence);
  ASSERT_EQ(verdicts.pieces.size(), 1U);
  EXPECT_EQ(verdicts.pieces[0].piece, piece(1));
  EXPECT_TRUE(verdicts.pieces[0].arrived);
  EXPECT_TRUE(verdicts.runs.empty()) << "as a loss it was told of already";
}

TEST(SentPackets, WhatLeftWithEctIsToldOfOnce) {
  Record r;
  r.message(at(0s), 3, 1ms);
  r.sent.set_ect(true);
  r.message(at(5ms), 4, 1ms);
  r.arrived.erase(6);
  const auto told = [&r](Duration now) {
    return r.sent.report(at(now), report_of(kA, r.arrived), 10ms, kSilence).ect_arrived;
  };
  EXPECT_EQ(told(20ms), 3U);
  EXPECT_EQ(told(25ms), 0U);
  // Also what arrives after its loss was certain.
  r.arrived.insert(6);
  EXPECT_EQ(told(600ms), 1U);
}

}  // namespace
}  // namespace interneuron::flow::sent_packets_test
