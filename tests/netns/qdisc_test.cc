// tc-netem as it is set by netlink: what was asked for is what packets see.
#include "netns/netem/qdisc.h"

#include <gmock/gmock.h>
#include <poll.h>
#include <sched.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>

#include "netem_support.h"
#include "netns/state/error.h"
#include "node/io/steady_clock.h"

namespace interneuron::netns::qdisc_test {
namespace {

using namespace std::chrono_literals;

double ms(Duration d) { return to_ms(d); }

double lost_fraction(const std::vector<Arrival>& arrivals, std::size_t sent) {
  return 1 - static_cast<double>(arrivals.size()) / static_cast<double>(sent);
}

Duration median_delay(std::vector<Arrival> arrivals) {
  const auto middle = arrivals.begin() + static_cast<std::ptrdiff_t>(arrivals.size() / 2);
  std::nth_element(arrivals.begin(), middle, arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.delay < b.delay; });
  return middle->delay;
}

std::size_t overtaken(const std::vector<Arrival>& arrivals) {
  std::size_t out = 0;
  for (std::size_t i = 1; i < arrivals.size(); ++i) {
    if (arrivals[i].number < arrivals[i - 1].number) ++out;
  }
  return out;
}

TEST_F(QdiscNetemTest, ConstantDelayOfBothEndsIsTheRoundTrip) {
  add(clean(100, 10ms));
  io::FileDescriptor reply(-1);
  {
    ASSERT_EQ(::setns(right_.get(), CLONE_NEWNET), 0);
    TrafficControl right;
    right.add("veth1", clean(100, 10ms));
    ASSERT_EQ(::setns(left_.get(), CLONE_NEWNET), 0);
  }
  std::vector<double> rtt;
  std::array<char, 64> buffer{};
  for (int i = 0; i < 50; ++i) {
    const TimePoint start = io::now();
    ASSERT_EQ(::send(left_udp_.get(), buffer.data(), buffer.size(), 0), 64);
    ASSERT_EQ(::recv(right_udp_.get(), buffer.data(), buffer.size(), 0), 64);
    ASSERT_EQ(::send(right_udp_.get(), buffer.data(), buffer.size(), 0), 64);
    ASSERT_EQ(::recv(left_udp_.get(), buffer.data(), buffer.size(), 0), 64);
    rtt.push_back(ms(io::now() - start));
  }
  std::sort(rtt.begin(), rtt.end());
  RecordProperty("rtt_min_ms", std::to_string(rtt.front()));
  RecordProperty("rtt_median_ms", std::to_string(rtt[25]));
  std::printf("rtt min %.3f median %.3f max %.3f ms\n", rtt.front(), rtt[25], rtt.back());
  EXPECT_GE(rtt.front(), 20.0);
  EXPECT_LT(rtt[25], 22.0);
}

TEST_F(QdiscNetemTest, KeepingTheOrderAddsNoDelay) {
  add(clean(1000, 20ms));
  const auto arrivals = send(5'000);
  ASSERT_EQ(arrivals.size(), 5'000U);
  EXPECT_EQ(overtaken(arrivals), 0U);
  std::printf("median delay %.3f ms\n", ms(median_delay(arrivals)));
  EXPECT_NEAR(ms(median_delay(arrivals)), 20.0, 1.5);
}

TEST_F(QdiscNetemTest, LossIsAsAskedAndCounted) {
  for (const double loss : {0.01, 0.05}) {
    emu::Conditions conditions = clean(1000, 1ms);
    conditions.loss = loss;
    add(conditions);
    constexpr std::size_t kCount = 100'000;
    const auto arrivals = send(kCount);
    std::printf("loss %.4f asked, %.4f seen\n", loss, lost_fraction(arrivals, kCount));
    EXPECT_NEAR(lost_fraction(arrivals, kCount), loss, 0.003);
    const EgressCounters seen = counters();
    EXPECT_EQ(seen.packets_in, kCount);
    EXPECT_EQ(seen.packets_sent, arrivals.size());
    EXPECT_EQ(seen.bytes_sent, 100 * arrivals.size());
    EXPECT_EQ(seen.bytes_in, 100 * kCount);
    EXPECT_EQ(seen.lost, kCount - arrivals.size());
    EXPECT_EQ(seen.queue_drops, 0U);
    control_.emplace();
  }
}

struct Bursts {
  std::size_t count = 0;
  double mean = 0;
};
Bursts bursts_of(const std::vector<Arrival>& arrivals) {
  Bursts out;
  std::size_t lost = 0;
  for (std::size_t i = 1; i < arrivals.size(); ++i) {
    const std::size_t gap = arrivals[i].number - arrivals[i - 1].number - 1;
    if (gap == 0) continue;
    ++out.count;
    lost += gap;
  }
  out.mean = static_cast<double>(lost) / static_cast<double>(std::max<std::size_t>(1, out.count));
  return out;
}

TEST_F(QdiscNetemTest, BurstsOfLossOutliveChangesOfTheDelay) {
  emu::Conditions conditions = clean(1000, 1ms);
  conditions.gilbert_elliott = emu::GilbertElliott{0.02, 0.25, 0, 1};
  add(conditions);
  constexpr std::size_t kCount = 100'000;
  constexpr std::size_t kBetweenChanges = 10;
  std::vector<Arrival> arrivals;
  for (std::uint32_t sent = 0; sent < kCount; sent += kBetweenChanges) {
    send_numbered(left_udp_.get(), sent, kBetweenChanges, 100);
    if (sent % 100 == 0) receive_numbered(right_udp_.get(), arrivals);
    conditions.one_way = sent % 20 == 0 ? 1ms : 2ms;
    change(conditions);
  }
  receive_numbered(right_udp_.get(), arrivals, 500ms);
  const Bursts bursts = bursts_of(arrivals);
  std::printf("%zu bursts of %.3f in the mean, loss %.4f\n", bursts.count, bursts.mean,
              lost_fraction(arrivals, kCount));
  EXPECT_GE(bursts.count, 1000U);
  EXPECT_NEAR(bursts.mean, 4.0, 0.4);
  EXPECT_NEAR(lost_fraction(arrivals, kCount), 0.02 / 0.27, 0.007);
  const EgressCounters seen = counters();
  EXPECT_EQ(seen.packets_in, kCount);
  EXPECT_EQ(seen.lost, kCount - arrivals.size());
}

TEST_F(QdiscNetemTest, BurstsBesideDuplicatesAndLoss) {
  emu::Conditions conditions = clean(1000, 1ms);
  conditions.loss = 0.1;
  conditions.duplicate = 1e-9;
  conditions.gilbert_elliott = emu::GilbertElliott{0.1, 0.1, 0, 0.5};
  add(conditions);
  constexpr std::size_t kCount = 50'000;
  // Half of the time half is lost, and of what remains a tenth.
  EXPECT_NEAR(lost_fraction(send(kCount), kCount), 1 - 0.75 * 0.9, 0.01);
  const EgressCounters before = counters();
  conditions.duplicate = 0;
  EXPECT_EQ(change(conditions), TrafficControl::kMostRequests);
  EXPECT_NEAR(lost_fraction(send(kCount), kCount), 1 - 0.75 * 0.9, 0.01);
  EXPECT_EQ(counters().packets_in, before.packets_in + kCount);
}

TEST_F(QdiscNetemTest, FallingDelayKeepsTheOrder) {
  emu::Conditions conditions = clean(100, 300ms);
  add(conditions);
  std::vector<Arrival> arrivals;
  constexpr std::uint32_t kSteps = 59;
  for (std::uint32_t step = 0; step < kSteps; ++step) {
    send_numbered(left_udp_.get(), step * 10, 10, 200);
    conditions.one_way -= 5ms;
    EXPECT_EQ(change(conditions), 1U);
    rest(2ms);
  }
  receive_numbered(right_udp_.get(), arrivals, 1s);
  EXPECT_EQ(arrivals.size(), kSteps * 10);
  EXPECT_EQ(overtaken(arrivals), 0U);
}

TEST_F(QdiscNetemTest, ChangeTellsOnlyWhatDiffers) {
  emu::Conditions conditions = clean(100, 10ms);
  conditions.loss = 1;
  add(conditions);
  EXPECT_EQ(change(conditions), 0U);
  conditions.one_way += 400ns;
  EXPECT_EQ(change(conditions), 0U);
  conditions.one_way += 10ms;
  EXPECT_EQ(change(conditions), 1U);
  EXPECT_TRUE(send(100).empty());  // the loss is still there
  conditions.loss = 0;
  conditions.rate = DataRate::mbit(50);
  EXPECT_EQ(change(conditions), 2U);
  const auto arrivals = send(100);
  ASSERT_EQ(arrivals.size(), 100U);
  EXPECT_GE(ms(arrivals.front().delay), 20.0);
  EXPECT_LT(ms(arrivals.front().delay), 30.0);
}

TEST_F(QdiscNetemTest, RateOfZeroLetsNothingPass) {
  add(clean(0, 1ms));
  EXPECT_TRUE(send(100).empty());
  change(clean(10, 1ms));
  EXPECT_EQ(send(100).size(), 100U);
}

TEST_F(QdiscNetemTest, DuplicatesAreAsAsked) {
  emu::Conditions conditions = clean(1000, 1ms);
  conditions.duplicate = 0.1;
  add(conditions);
  constexpr std::size_t kCount = 20'000;
  EXPECT_NEAR(static_cast<double>(send(kCount).size()) / kCount, 1.1, 0.01);
}

TEST_F(QdiscNetemTest, CorruptedPacketsFailTheirChecksum) {
  emu::Conditions conditions = clean(1000, 1ms);
  conditions.corrupt = 0.1;
  add(conditions);
  constexpr std::size_t kCount = 20'000;
  // A flipped bit of the Ethernet source address harms nobody: 6 of 114 bytes.
  EXPECT_NEAR(lost_fraction(send(kCount), kCount), 0.1 * 108 / 114, 0.015);
}

TEST_F(QdiscNetemTest, ReorderedPacketsOvertake) {
  emu::Conditions conditions = clean(1000, 20ms);
  conditions.reorder = 0.05;
  add(conditions);
  const auto arrivals = send(2'000);
  ASSERT_EQ(arrivals.size(), 2'000U);
  const auto early = std::count_if(arrivals.begin(), arrivals.end(),
                                   [](const Arrival& a) { return a.delay < 15ms; });
  std::printf("%td of 2000 overtook\n", early);
  EXPECT_NEAR(static_cast<double>(early), 100, 40);
}

TEST_F(QdiscNetemTest, RemovedItIsAnOrdinaryNic) {
  add(clean(100, 50ms));
  control_->remove(nic_);
  const auto arrivals = send(100);
  ASSERT_EQ(arrivals.size(), 100U);
  EXPECT_LT(ms(median_delay(arrivals)), 20.0);
}

TEST_F(QdiscNetemTest, HundredsOfChangesASecond) {
  emu::Conditions conditions = clean(100, 10ms);
  add(conditions);
  constexpr int kChanges = 500;
  const TimePoint start = io::now();
  for (int i = 0; i < kChanges; ++i) {
    conditions.one_way += 1us;
    ASSERT_EQ(change(conditions), 1U);
  }
  const double each_us = ms(io::now() - start) * 1000 / kChanges;
  std::printf("%.1f us a change\n", each_us);
  EXPECT_LT(each_us, 5'000);  // 2 links x 2 directions x 50 a second
}

// Whatever the kernel has.
class QdiscWithoutNetemTest : public testing::Test {};

TEST_F(QdiscWithoutNetemTest, TheErrorNamesTheRemedies) {
  if (::unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "may not make network namespaces: needs root";
  if (kernel_has_netem()) GTEST_SKIP() << "this kernel has netem";
  TrafficControl control;
  try {
    control.add("lo", clean(10, 1ms));
    FAIL() << "netem was added to a kernel without it";
  } catch (const TestbedError& error) {
    EXPECT_EQ(error.exit_code, 1);
    EXPECT_STREQ(error.what(),
                 "tc-netem is not in this kernel; --backend emulator does without it, or "
                 "scripts/vm.sh runs the command in a kernel that has it");
  }
  EXPECT_THROW(control.add("nonesuch", clean(10, 1ms)), TestbedError);
}

}  // namespace
}  // namespace interneuron::netns::qdisc_test
