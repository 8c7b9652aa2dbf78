#include "lab/emu/link_model.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "support.h"

namespace interneuron::emu::link_model_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(LinkModel, DelayIsTransmissionPlusHalfTheRoundTrip) {
  LinkModel link = constant_link({DataRate::mbit(100), kMegabyte}, 20);
  ASSERT_TRUE(link.enqueue(seconds(1), 1250, 7));  // 1250 bytes at 100 Mbit/s: 100 us
  EXPECT_EQ(link.next_delivery(), seconds(1) + microseconds(10'100));
  EXPECT_FALSE(link.dequeue(seconds(1) + microseconds(10'099)).has_value());
  const auto packet = link.dequeue(seconds(1) + microseconds(10'100));
  ASSERT_TRUE(packet.has_value());
  EXPECT_EQ(packet->tag, 7U);
  EXPECT_EQ(packet->ip_bytes, 1250U);
  EXPECT_FALSE(link.next_delivery().has_value());
}

TEST(LinkModel, RateIsExactOverAMillionPackets) {
  // 1428 bytes at 300 Mbit/s take 38.08 us; at 65 Mbit/s a fraction of a nanosecond remains.
  for (const double mbit : {300.0, 65.0, 7.3}) {
    LinkModel link = constant_link({DataRate::mbit(mbit), kMegabyte * 10'000}, 20);
    constexpr int kPackets = 1'000'000;
    Duration last{};
    for (int i = 0; i < kPackets; ++i) {
      // Always a few in the queue.
      ASSERT_TRUE(link.enqueue(std::max(Duration{}, last - milliseconds(20)), 1428, 0));
      last = link.dequeue(kEver)->due;
    }
    const double expected_ns = kPackets * 1428.0 * 8e3 / mbit;
    EXPECT_NEAR(static_cast<double>((last - milliseconds(10)).count()), expected_ns, 1.0) << mbit;
  }
}

TEST(LinkModel, DropsAtTheTailOfTheQueue) {
  // 10 packets of 1000 bytes wait at most; one takes 1 ms.
  LinkModel link = constant_link({DataRate::mbit(8), 10'000}, 20);
  for (std::uint64_t i = 0; i < 10; ++i) EXPECT_TRUE(link.enqueue(Duration{}, 1000, i));
  EXPECT_FALSE(link.enqueue(Duration{}, 1000, 10));
  EXPECT_FALSE(link.enqueue(microseconds(999), 1000, 11));
  EXPECT_TRUE(link.enqueue(milliseconds(1), 1000, 12));
  EXPECT_FALSE(link.enqueue(milliseconds(1), 1000, 13));
  EXPECT_EQ(link.stats().queue_drops, 3U);
  EXPECT_EQ(link.stats().lost, 0U);
  std::vector<std::uint64_t> tags;
  while (const auto packet = link.dequeue(seconds(1))) tags.push_back(packet->tag);
  EXPECT_EQ(tags, (std::vector<std::uint64_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12}));
}

TEST(LinkModel, QueueDoesNotCountTheDelayLine) {
  // 500 ms in the delay line at 8 Mbit/s are 500 kB, fifty times the queue.
  LinkModel link = constant_link({DataRate::mbit(8), 10'000}, 1000);
  for (int ms = 0; ms < 500; ++ms) ASSERT_TRUE(link.enqueue(milliseconds(ms), 1000, 0));
  EXPECT_EQ(link.stats().queue_drops, 0U);
}

TEST(LinkModel, IdleLinkTakesAPacketLargerThanItsQueue) {
  LinkModel link = constant_link({DataRate::mbit(8), 100}, 20);
  EXPECT_TRUE(link.enqueue(Duration{}, 1500, 0));
  EXPECT_FALSE(link.enqueue(Duration{}, 1500, 1));
}

TEST(LinkModel, QueueCountsPacketsToo) {
  DirectionParams params = rate_of_mbit(8);
  params.queue_packets = 3;
  LinkModel link = constant_link(params, 20);
  for (std::uint64_t i = 0; i < 3; ++i) EXPECT_TRUE(link.enqueue(Duration{}, 1000, i));
  EXPECT_FALSE(link.enqueue(Duration{}, 40, 3));
  EXPECT_EQ(link.waiting_bytes(Duration{}), 3000U);
  EXPECT_TRUE(link.enqueue(milliseconds(1), 1000, 4));
  EXPECT_EQ(link.stats().queue_drops, 1U);
}

TEST(LinkModel, QueueIsEmptyWhenTheLastHasLeft) {
  LinkModel link = constant_link(rate_of_mbit(8, 10'000), 20);
  for (std::uint64_t i = 0; i < 10; ++i) EXPECT_TRUE(link.enqueue(Duration{}, 1000, i));
  EXPECT_EQ(link.waiting_bytes(microseconds(9'999)), 1000U);
  EXPECT_EQ(link.waiting_bytes(milliseconds(10)), 0U);
}

TEST(LinkModel, NothingWaitsLongerThanTheProcessRemembers) {
  LinkModel link = constant_link(rate_of_mbit(0.008), 20);  // a packet of 1000 bytes per second
  int accepted = 0;
  for (int i = 0; i < 20; ++i) accepted += link.enqueue(Duration{}, 1000, 0) ? 1 : 0;
  EXPECT_EQ(accepted, 10);
  EXPECT_EQ(link.stats().queue_drops, 10U);
}

TEST(LinkModel, WithoutARateNothingPasses) {
  LinkModel link = constant_link({DataRate{}, kMegabyte}, 20);
  EXPECT_FALSE(link.enqueue(Duration{}, 100, 0));
  EXPECT_EQ(link.stats().queue_drops, 1U);
}

TEST(LinkModel, LosesTheShareThatTheProfileNames) {
  LinkModel link = constant_link({DataRate::mbit(1000), kMegabyte}, 20, 0.03);
  constexpr int kPackets = 200'000;
  for (int i = 0; i < kPackets; ++i) {
    link.enqueue(milliseconds(i), 100, 0);
    while (link.dequeue(milliseconds(i))) {
    }
  }
  // Binomial: sd 76 of 6000.
  EXPECT_NEAR(static_cast<double>(link.stats().lost), 6000, 300);
  EXPECT_EQ(link.stats().packets_in, static_cast<std::uint64_t>(kPackets));
}

TEST(LinkModel, LostPacketsUseTheBottleneck) {
  LinkModel link = constant_link({DataRate::mbit(8), 10'000}, 20, 1.0);
  for (int i = 0; i < 20; ++i) link.enqueue(Duration{}, 1000, 0);
  EXPECT_EQ(link.stats().lost, 10U);
  EXPECT_EQ(link.stats().queue_drops, 10U);
}

TEST(LinkModel, BothDirectionsReadOneProcess) {
  Link link(profile_of("4g"), 3);
  DelayProcess alone(profile_of("4g").delay, 3);
  for (int i = 0; i < 20'000; ++i) {
    const Duration t = milliseconds(10 * i);
    ASSERT_EQ(link.process()->at(t).rtt, alone.at(t).rtt);
    link.up().enqueue(t, 1400, 0);
    link.down().enqueue(t, 1400, 0);
    while (link.up().dequeue(t)) {
    }
    while (link.down().dequeue(t)) {
    }
  }
}

RC_GTEST_PROP(LinkModel, NeverExceedsItsRate, ()) {
  const auto sizes = *rc::gen::container<std::vector<std::size_t>>(200, rc::gen::inRange(20, 1501));
  LinkModel link = constant_link({DataRate::mbit(10), kMegabyte}, 20);
  std::size_t bytes = 0;
  for (const std::size_t size : sizes) {
    RC_ASSERT(link.enqueue(Duration{}, size, 0));
    bytes += size;
    const Duration due = link.dequeue(seconds(100))->due;
    RC_ASSERT(due - milliseconds(10) == Duration{static_cast<std::int64_t>(bytes) * 800});
  }
}

}  // namespace
}  // namespace interneuron::emu::link_model_test
