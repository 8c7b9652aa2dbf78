// Rate and queue of a link made by tc-netem.
#include <algorithm>
#include <cstdio>

#include "host/io/steady_clock.h"
#include "netem_support.h"

namespace interneuron::netns::netem_bottleneck_test {
namespace {

using namespace std::chrono_literals;

using NetemBottleneckTest = QdiscNetemTest;

// Mbit/s of IP bytes between the first and the last arrival.
double rate_mbit(const std::vector<Arrival>& arrivals, std::size_t ip_bytes) {
  const Duration span = arrivals.back().at - arrivals.front().at;
  return rate_of((arrivals.size() - 1) * ip_bytes, span).mbit();
}

// The median of that over 20 packets at a time, where nothing was in the way: a busy machine that
// stalls the kernel for longer than its burst makes up for takes from the rate, and what follows
// has that burst. 0 when that was nowhere.
double undisturbed_rate_mbit(const std::vector<Arrival>& arrivals, std::size_t ip_bytes,
                             DataRate asked) {
  constexpr std::size_t kWindow = 20;
  const Duration longest_gap = asked.transmit_time(ip_bytes) + 1ms;
  std::vector<double> rates;
  bool before = false;
  for (std::size_t i = kWindow; i < arrivals.size(); i += kWindow) {
    bool undisturbed = true;
    for (std::size_t k = i - kWindow; k < i; ++k) {
      undisturbed = undisturbed && arrivals[k + 1].at - arrivals[k].at < longest_gap;
    }
    const Duration span = arrivals[i].at - arrivals[i - kWindow].at;
    if (undisturbed && before) rates.push_back(rate_of(kWindow * ip_bytes, span).mbit());
    before = undisturbed;
  }
  std::sort(rates.begin(), rates.end());
  return rates.size() < 5 ? 0 : rates[rates.size() / 2];
}

// How much of the time between first and last went by in gaps longer than `longest`.
double stalled(const std::vector<Arrival>& arrivals, Duration longest) {
  Duration lost{};
  for (std::size_t i = 1; i < arrivals.size(); ++i) {
    lost += std::max(Duration{}, arrivals[i].at - arrivals[i - 1].at - longest);
  }
  return to_ms(lost) / to_ms(arrivals.back().at - arrivals.front().at);
}

TEST_F(NetemBottleneckTest, RateIsThatOfIpBytes) {
  struct Case {
    double mbit;
    std::size_t ip_bytes;
    std::size_t count;
  };
  for (const Case& c : {Case{2, 200, 2'000}, Case{10, 1400, 1'500}, Case{50, 1400, 5'000},
                        Case{150, 1400, 15'000}}) {
    add(clean(c.mbit, 5ms));
    // Not received before all have come: a receiver that wakes for each takes the whole processor
    // of a slow virtual machine.
    send_numbered(left_udp_.get(), 0, c.count, c.ip_bytes);
    rest(DataRate::mbit(c.mbit).transmit_time(c.count * c.ip_bytes));
    std::vector<Arrival> arrivals;
    receive_numbered(right_udp_.get(), arrivals, 500ms);
    ASSERT_EQ(arrivals.size(), c.count);
    const double seen = undisturbed_rate_mbit(arrivals, c.ip_bytes, DataRate::mbit(c.mbit));
    std::printf("%g Mbit/s asked, %.3f seen, %.3f in the mean\n", c.mbit, seen,
                rate_mbit(arrivals, c.ip_bytes));
    EXPECT_LT(rate_mbit(arrivals, c.ip_bytes) / c.mbit, 1.03);
    if (seen > 0) {
      EXPECT_NEAR(seen / c.mbit, 1.0, 0.03);
    }
    control_.emplace();
  }
}

TEST_F(NetemBottleneckTest, RateThatChangesOftenKeepsItsMean) {
  emu::Conditions conditions = clean(10, 5ms);
  add(conditions);
  constexpr std::size_t kCount = 4'000;
  std::vector<Arrival> arrivals;
  send_numbered(left_udp_.get(), 0, kCount, 1400);
  TimePoint next = io::now();
  double mbit_seconds = 0;
  TimePoint since = next;
  while (arrivals.size() < kCount && mbit_seconds < 100) {
    next += 20ms;
    rest(next - io::now());
    receive_numbered(right_udp_.get(), arrivals);
    const TimePoint now = io::now();
    mbit_seconds += conditions.rate.mbit() * to_ms(now - since) / 1000;
    since = now;
    conditions.rate = DataRate::mbit(conditions.rate.mbit() > 20 ? 10 : 30);
    change(conditions);
  }
  ASSERT_EQ(arrivals.size(), kCount);
  const double waste = stalled(arrivals, 2ms);
  std::printf("20 Mbit/s asked, %.3f seen, %.1f %% stalled\n", rate_mbit(arrivals, 1400),
              100 * waste);
  EXPECT_LT(rate_mbit(arrivals, 1400) / 20, 1.03);
  if (waste > 0.01) GTEST_SKIP() << "the machine is too busy to tell more";
  EXPECT_GT(rate_mbit(arrivals, 1400) / 20, 0.97);
}

// Rests 2 ms again and again for `time`, calling `each` before; returns the longest rest. A busy
// computer that stops the whole machine for s ms makes everything due in that time arrive at once
// afterwards, and nobody sees that but a clock.
template <class Each>
Duration longest_rest(Duration time, Each each) {
  Duration longest{};
  const TimePoint end = io::now() + time;
  for (TimePoint now = io::now(); now < end;) {
    each();
    rest(2ms);
    longest = std::max(longest, io::now() - now);
    now = io::now();
  }
  return longest;
}

TEST_F(NetemBottleneckTest, QueueLimitIsInBytesAndOfTheBottleneckAlone) {
  constexpr int kAttempts = 5;
  constexpr Duration kOneWay = 500ms;
  emu::Conditions conditions = clean(8, kOneWay);
  conditions.queue_bytes = 30'000;
  add(conditions);
  std::vector<Arrival> arrivals;
  // 8 Mbit/s for 0.5 s are 500 kB on the way, far more than the queue takes; it fills when 60 ms of
  // packets that are 2 ms apart come at once.
  Duration stop = 1h;
  std::uint64_t drops = 0;
  for (int i = 0; i < kAttempts && stop > 40ms; ++i) {
    arrivals.clear();
    drops = counters().queue_drops;
    std::uint32_t sent = 0;
    stop = longest_rest(5 * kOneWay, [&] {
      if (sent < 250) send_numbered(left_udp_.get(), sent++, 1, 1000);
    });
    receive_numbered(right_udp_.get(), arrivals, 1s);
  }
  if (stop > 40ms) GTEST_SKIP() << "the machine is too busy to tell";
  EXPECT_EQ(arrivals.size(), 250U);
  EXPECT_EQ(counters().queue_drops, drops);

  // At 10 ms a packet hardly any leaves while the 200 arrive, which takes a slow virtual machine
  // 20 ms.
  conditions.rate = DataRate::mbit(0.8);
  EXPECT_EQ(change(conditions), 1U);
  stop = 1h;
  for (int i = 0; i < kAttempts && stop > 20ms; ++i) {
    arrivals.clear();
    drops = counters().queue_drops;
    send_numbered(left_udp_.get(), 0, 200, 1000);
    stop = longest_rest(2 * kOneWay, [] {});
    receive_numbered(right_udp_.get(), arrivals, 1s);
  }
  if (stop > 20ms) GTEST_SKIP() << "the machine is too busy to tell more";
  std::printf("%zu of 200 passed a queue of 30\n", arrivals.size());
  EXPECT_GE(arrivals.size(), 30U);
  EXPECT_LE(arrivals.size(), 34U);  // and those that a burst lets through at once
  EXPECT_EQ(counters().queue_drops - drops, 200 - arrivals.size());
  EXPECT_EQ(counters().lost, 0U);
}

TEST_F(NetemBottleneckTest, QueueLimitMayBeInPackets) {
  emu::Conditions conditions = clean(1, 1ms);
  conditions.queue_packets = 20;
  add(conditions);
  std::vector<Arrival> arrivals;
  send_numbered(left_udp_.get(), 0, 100, 500);
  receive_numbered(right_udp_.get(), arrivals, 500ms);
  EXPECT_NEAR(static_cast<double>(arrivals.size()), 21, 1);

  conditions.queue_packets = 0;
  conditions.queue_bytes = 5'000;
  EXPECT_EQ(change(conditions), 1U);
  arrivals.clear();
  send_numbered(left_udp_.get(), 0, 100, 500);
  receive_numbered(right_udp_.get(), arrivals, 500ms);
  EXPECT_NEAR(static_cast<double>(arrivals.size()), 11, 1);
  conditions.queue_packets = 2;
  EXPECT_EQ(change(conditions), 1U);
  EXPECT_EQ(change(conditions), 0U);
}

}  // namespace
}  // namespace interneuron::netns::netem_bottleneck_test
