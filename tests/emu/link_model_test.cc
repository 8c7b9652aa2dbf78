#include "emu/link_model.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

#include "support.h"

namespace interneuron::emu {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kMegabyte = 1'000'000;

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
      ASSERT_TRUE(link.enqueue(Duration{}, 1428, 0));
      last = link.dequeue(seconds(100'000))->due;
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

RC_GTEST_PROP(LinkModel, KeepsTheOrderAndTheBooks, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  LinkProfile profile = profile_of("4g");
  profile.up = {DataRate::mbit(5), 100'000};  // tight, so that queue drops occur
  Link link(profile, seed);

  // Few, or finding the smallest failing case would take minutes.
  const auto gaps_us = *rc::gen::container<std::vector<int>>(300, rc::gen::inRange(0, 40'000));
  Duration now = seconds(*rc::gen::inRange(0, 100));
  Duration last_due{};
  std::uint64_t next_tag = 0;
  std::uint64_t last_tag = 0;
  std::uint64_t inside = 0;
  for (const int gap_us : gaps_us) {
    now += gap_us % 3 == 0 ? Duration{} : microseconds(gap_us / 8);
    if (link.up().enqueue(now, static_cast<std::size_t>(40 + gap_us % 1460), ++next_tag)) ++inside;
    const auto announced = link.up().next_delivery();
    while (const auto packet = link.up().dequeue(now)) {
      RC_ASSERT(packet->tag > last_tag);
      RC_ASSERT(packet->due >= last_due);
      RC_ASSERT(packet->due <= now);
      RC_ASSERT(announced.has_value());
      last_tag = packet->tag;
      last_due = packet->due;
      --inside;
    }
  }
  const DirectionStats& stats = link.up().stats();
  RC_ASSERT(stats.packets_in == next_tag);
  RC_ASSERT(stats.packets_in == stats.delivered + stats.lost + stats.queue_drops + inside);
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
}  // namespace interneuron::emu
