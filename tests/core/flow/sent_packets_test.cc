#include "core/flow/sent_packets.h"

#include <gtest/gtest.h>

#include "sender_support.h"

namespace interneuron::flow {
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

}  // namespace
}  // namespace interneuron::flow
