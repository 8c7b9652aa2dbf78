// What every back end of the testbed must do, measured from outside by sockets. The same tests run
// over the emulator everywhere and over tc-netem where the kernel has it (`scripts/vm.sh` boots one
// that has). Counts are exact or statistical; bounds on time are generous, as test machines are
// shared and user-mode Linux is slow.
#include <gmock/gmock.h>
#include <linux/sock_diag.h>
#include <linux/udp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <thread>
#include <vector>

#include "netns/state/error.h"
#include "netns/testbed/testbed.h"
#include "support.h"
#include "tests/run_queue.h"

namespace interneuron::netns::conformance_test {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t kBatch = 50;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

struct Arrival {
  std::uint32_t number;
  Clock::time_point at;
};

// Everything that arrives until nothing has for `patience`.
std::vector<Arrival> receive_all(int fd, milliseconds patience, std::size_t at_most = SIZE_MAX) {
  std::vector<Arrival> out;
  std::array<std::array<char, 1500>, kBatch> buffers{};
  std::array<iovec, kBatch> vectors{};
  std::array<mmsghdr, kBatch> messages{};
  for (std::size_t i = 0; i < kBatch; ++i) {
    vectors[i] = {buffers[i].data(), buffers[i].size()};
    messages[i].msg_hdr.msg_iov = &vectors[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  while (out.size() < at_most && readable(fd, static_cast<int>(patience.count()))) {
    const int count = ::recvmmsg(fd, messages.data(), kBatch, MSG_DONTWAIT, nullptr);
    const auto now = Clock::now();
    for (int i = 0; i < count; ++i) {
      Arrival arrival{0, now};
      std::memcpy(&arrival.number, buffers[static_cast<std::size_t>(i)].data(), 4);
      out.push_back(arrival);
    }
  }
  return out;
}

// Numbered datagrams of `size` bytes, `pace` per second, in batches: system calls are dear in
// user-mode Linux.
void send_numbered(int fd, std::uint32_t count, std::size_t size, double pace) {
  std::vector<std::vector<char>> payload(kBatch, std::vector<char>(size));
  std::array<iovec, kBatch> vectors{};
  std::array<mmsghdr, kBatch> messages{};
  const auto start = Clock::now();
  for (std::uint32_t sent = 0; sent < count;) {
    const auto batch = std::min<std::uint32_t>(kBatch, count - sent);
    for (std::uint32_t i = 0; i < batch; ++i) {
      const std::uint32_t number = sent + i;
      std::memcpy(payload[i].data(), &number, 4);
      vectors[i] = {payload[i].data(), size};
      messages[i].msg_hdr.msg_iov = &vectors[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int done = ::sendmmsg(fd, messages.data(), batch, 0);
    if (done > 0) sent += static_cast<std::uint32_t>(done);
    std::this_thread::sleep_until(start + std::chrono::duration_cast<Clock::duration>(
                                              std::chrono::duration<double>(sent / pace)));
  }
}

// What came out of a link, and what a slow receiver could not take.
struct Transfer {
  std::vector<Arrival> arrivals;
  std::uint32_t missed = 0;
  std::size_t through() const { return arrivals.size() + missed; }
};

std::uint32_t drops_of(int fd) {
  std::array<std::uint32_t, SK_MEMINFO_VARS> memory{};
  socklen_t size = sizeof memory;
  ::getsockopt(fd, SOL_SOCKET, SO_MEMINFO, memory.data(), &size);
  return memory[SK_MEMINFO_DROPS];
}

Transfer transfer(const UdpPair& sockets, std::uint32_t count, std::size_t size, double pace) {
  Transfer out;
  const std::uint32_t before = drops_of(sockets.road.get());
  std::thread receiver([&] { out.arrivals = receive_all(sockets.road.get(), milliseconds(1500)); });
  send_numbered(sockets.vehicle.get(), count, size, pace);
  receiver.join();
  out.missed = drops_of(sockets.road.get()) - before;
  return out;
}

// Where others use the machine, one measurement of time may be spoilt; not every one, unless they
// never rest.
constexpr int kAttempts = 5;

class Conformance : public NetnsTest, public testing::WithParamInterface<Backend> {
 protected:
  void SetUp() override {
    NetnsTest::SetUp();
    if (IsSkipped() || GetParam() != Backend::kNetem) return;
    const RuntimeDir scratch;
    TestbedOptions options = clean_options(scratch);
    options.backend = Backend::kNetem;
    try {
      Testbed::up(options);
    } catch (const TestbedError& error) {
      GTEST_SKIP() << error.what();
    }
  }

  // One link with this profile's lines after the name.
  Testbed up(const std::string& lines) {
    const auto file = dir_.path() / "profile.toml";
    std::ofstream(file) << "schema = 1\nname = \"test\"\ndescription = \"test\"\n" << lines;
    TestbedOptions options{.scenario = scenario_of({"test=" + file.string()}, 1),
                           .backend = GetParam(),
                           .runtime_dir = dir_.path()};
    return Testbed::up(options);
  }

  static std::string constant(double rtt_ms, const std::string& loss, double mbit,
                              const std::string& more = "") {
    const std::string direction = "rate_mbit = " + std::to_string(mbit) + "\n" + more;
    return "model = \"constant\"\nrtt_ms = " + std::to_string(rtt_ms) + "\nloss = " + loss +
           "\n[up]\n" + direction + "[down]\n" + direction;
  }
};

// The first packet may find the link's time at its beginning.
void warm_up(const UdpPair& sockets) {
  for (int i = 0; i < 3; ++i) send_numbered(sockets.vehicle.get(), 1, 60, 100);
  receive_all(sockets.road.get(), milliseconds(300));
}

double median_rtt_ms(const UdpPair& sockets, int count = 30) {
  std::vector<double> times;
  char byte = 0;
  for (int i = 0; i < count; ++i) {
    const auto start = Clock::now();
    if (::send(sockets.vehicle.get(), "x", 1, 0) != 1 || !readable(sockets.road.get()) ||
        ::recv(sockets.road.get(), &byte, 1, 0) != 1 ||
        ::send(sockets.road.get(), "x", 1, 0) != 1 || !readable(sockets.vehicle.get()) ||
        ::recv(sockets.vehicle.get(), &byte, 1, 0) != 1) {
      return -1;
    }
    times.push_back(ms_since(start));
  }
  std::nth_element(times.begin(), times.begin() + count / 2, times.end());
  return times[static_cast<std::size_t>(count) / 2];
}

TEST_P(Conformance, RoundTripTime) {
  const Testbed testbed = up(constant(40, "0", 100));
  const UdpPair sockets = udp_pair(testbed.state());
  warm_up(sockets);
  const RunQueue queue;
  double median = 0;
  for (int i = 0; i < kAttempts && !(median >= 40 && median <= 43); ++i) {
    median = median_rtt_ms(sockets);
  }
  RecordProperty("median_ms", std::to_string(median));
  if (median > 43 && queue.busy()) GTEST_SKIP() << "the machine is too busy to tell: " << median;
  EXPECT_THAT(median, testing::AllOf(testing::Ge(40), testing::Le(43)));
}

double lost_percent(const Testbed& testbed, std::uint32_t packets) {
  const Transfer seen = transfer(udp_pair(testbed.state()), packets, 60, 10'000);
  const std::size_t lost = packets - seen.through();
  EXPECT_TRUE(eventually([&] {
    const auto up = testbed.snapshot().links.at(0).up;
    return up.delivered == seen.through() && up.lost == lost;
  })) << testbed.snapshot().links.at(0).up.delivered
      << " delivered, " << testbed.snapshot().links.at(0).up.lost << " lost; came through "
      << seen.through();
  return 100.0 * static_cast<double>(lost) / packets;
}

TEST_P(Conformance, LossOfFivePercentWithinThreeTenthsOfAPoint) {
  const double lost = lost_percent(up(constant(10, "0.05", 100)), 60'000);
  RecordProperty("lost_percent", std::to_string(lost));
  EXPECT_NEAR(lost, 5, 0.3);
}

TEST_P(Conformance, LossOfOnePercentWithinThreeTenthsOfAPoint) {
  const double lost = lost_percent(up(constant(10, "0.01", 100)), 60'000);
  RecordProperty("lost_percent", std::to_string(lost));
  EXPECT_NEAR(lost, 1, 0.3);
}

// In Mbit/s of IP, over the middle half of what arrived: the queue is full then.
double bottleneck_rate(const UdpPair& sockets) {
  const Transfer seen = transfer(sockets, 6000, 1400, 2700);  // 31 Mbit/s
  const std::vector<Arrival>& arrivals = seen.arrivals;
  if (arrivals.size() < 1000 || seen.missed > 0) return 0;
  const Arrival& first = arrivals[arrivals.size() / 4];
  const Arrival& last = arrivals[arrivals.size() * 3 / 4];
  const double seconds = to_seconds(last.at - first.at);
  return static_cast<double>(arrivals.size() / 2) * 1428 * 8 / 1e6 / seconds;
}

TEST_P(Conformance, RateWithinThreePercent) {
  const Testbed testbed = up(constant(10, "0", 20, "queue_kbyte = 400\n"));
  const UdpPair sockets = udp_pair(testbed.state());
  warm_up(sockets);
  const RunQueue queue;
  double mbit = 0;
  for (int i = 0; i < kAttempts && std::abs(mbit - 20) > 0.6; ++i) mbit = bottleneck_rate(sockets);
  RecordProperty("mbit", std::to_string(mbit));
  if (std::abs(mbit - 20) > 0.6 && queue.busy())
    GTEST_SKIP() << "the machine is too busy to tell: " << mbit;
  EXPECT_NEAR(mbit, 20, 0.6);
  EXPECT_TRUE(eventually([&] { return testbed.snapshot().links.at(0).up.queue_drops > 500; }));
}

TEST_P(Conformance, InOrderWhileTheDelayFalls) {
  const Testbed testbed = up(constant(300, "0", 100));
  const UdpPair sockets = udp_pair(testbed.state());
  warm_up(sockets);
  std::vector<Arrival> arrivals;
  const std::uint32_t before = drops_of(sockets.road.get());
  std::thread receiver([&] { arrivals = receive_all(sockets.road.get(), milliseconds(1500)); });
  std::thread sender([&] { send_numbered(sockets.vehicle.get(), 4000, 200, 4000); });
  for (const char* rtt : {"rtt_ms=200", "rtt_ms=20", "rtt_ms=250", "rtt_ms=10"}) {
    std::this_thread::sleep_for(milliseconds(200));
    Testbed::change(testbed.state(), "test", {rtt});
  }
  sender.join();
  receiver.join();
  EXPECT_EQ(arrivals.size() + drops_of(sockets.road.get()) - before, 4000U);
  EXPECT_TRUE(
      std::is_sorted(arrivals.begin(), arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.number < b.number; }));
}

TEST_P(Conformance, ChangesWhileItRuns) {
  const Testbed testbed = up(constant(10, "0", 100));
  const UdpPair sockets = udp_pair(testbed.state());
  warm_up(sockets);
  Testbed::change(testbed.state(), "*", {"rtt_ms=120"});
  double median = 0;
  EXPECT_TRUE(eventually([&] {
    median = median_rtt_ms(sockets, 9);
    return median >= 119 && median <= 130;
  })) << median;
  Testbed::change(testbed.state(), "*", {"rtt_ms=10", "up.loss=1"});
  EXPECT_TRUE(eventually([&] { return transfer(sockets, 20, 60, 500).through() == 0; },
                         std::chrono::seconds(20)));
}

TEST_P(Conformance, RefusesChangesThatItCannotMake) {
  const Testbed testbed = up(constant(10, "0", 100));
  if (GetParam() == Backend::kEmulator) {
    EXPECT_NO_THROW(Testbed::change(testbed.state(), "test", {"mtu=1300"}));
    return;
  }
  try {
    Testbed::change(testbed.state(), "test", {"mtu=1300"});
    ADD_FAILURE() << "accepted";
  } catch (const TestbedError& error) {
    EXPECT_EQ(error.exit_code, 3);
    EXPECT_THAT(error.what(), testing::HasSubstr("mtu"));
  }
}

TEST_P(Conformance, NothingPassesInAnOutage) {
  const Testbed testbed = up(constant(10, "0", 100));
  const UdpPair sockets = udp_pair(testbed.state());
  warm_up(sockets);
  Testbed::outage(testbed.state(), "test", std::chrono::seconds(6));
  EXPECT_TRUE(eventually([&] { return transfer(sockets, 20, 60, 500).through() == 0; }));
  EXPECT_TRUE(eventually([&] { return transfer(sockets, 50, 60, 500).through() == 50; },
                         std::chrono::seconds(30)));
}

// A kernel that segments for the sender (UDP_SEGMENT) must not make one packet of ten.
TEST_P(Conformance, SegmentsOfOneSendAreLostOneByOne) {
  const Testbed testbed = up(constant(10, "0.2", 100));
  const UdpPair sockets = udp_pair(testbed.state());
  constexpr int kSegment = 1000;  // bytes
  constexpr std::uint32_t kSegments = 10;
  constexpr std::uint32_t kSends = 300;
  ASSERT_EQ(
      ::setsockopt(sockets.vehicle.get(), IPPROTO_UDP, UDP_SEGMENT, &kSegment, sizeof kSegment), 0);
  std::vector<Arrival> arrivals;
  std::thread receiver([&] { arrivals = receive_all(sockets.road.get(), milliseconds(1500)); });
  std::vector<char> datagrams(kSegments * kSegment);
  for (std::uint32_t i = 0; i < kSends; ++i) {
    for (std::uint32_t k = 0; k < kSegments; ++k) {
      const std::uint32_t number = i * kSegments + k;
      std::memcpy(&datagrams[k * kSegment], &number, 4);
    }
    EXPECT_EQ(::send(sockets.vehicle.get(), datagrams.data(), datagrams.size(), 0),
              static_cast<ssize_t>(datagrams.size()));
    std::this_thread::sleep_for(milliseconds(1));
  }
  receiver.join();
  std::array<std::uint32_t, kSends> came{};
  for (const Arrival& arrival : arrivals) ++came.at(arrival.number / kSegments);
  const auto partly = std::count_if(came.begin(), came.end(),
                                    [](std::uint32_t n) { return n > 0 && n < kSegments; });
  EXPECT_GT(partly, kSends / 2);  // 89 % where each is lost by itself
  EXPECT_TRUE(eventually(
      [&] { return testbed.snapshot().links.at(0).up.packets_in == kSends * kSegments; }));
}

TEST_P(Conformance, BurstsOfLossAsLongAsAsked) {
  // A burst begins after 2 % of the good packets and has 4 in the mean.
  const Testbed testbed = up(constant(10, "0", 100, "gilbert_elliott = { p = 0.02, r = 0.25 }\n"));
  const UdpPair sockets = udp_pair(testbed.state());
  std::vector<Arrival> arrivals;
  const RunQueue queue;
  for (int i = 0; i < kAttempts && arrivals.empty(); ++i) {
    Transfer seen = transfer(sockets, 70'000, 60, 15'000.0 / (i + 1));
    if (seen.missed == 0) arrivals = std::move(seen.arrivals);
  }
  if (arrivals.empty() && queue.busy()) GTEST_SKIP() << "the machine is too busy to receive all";
  double bursts = 0;
  double lost = 0;
  for (std::size_t i = 1; i < arrivals.size(); ++i) {
    const std::uint32_t gap = arrivals[i].number - arrivals[i - 1].number - 1;
    lost += gap;
    bursts += gap > 0 ? 1 : 0;
  }
  ASSERT_GE(bursts, 1000);
  RecordProperty("burst_length", std::to_string(lost / bursts));
  EXPECT_NEAR(lost / bursts, 4, 0.4);
}

INSTANTIATE_TEST_SUITE_P(BackEnds, Conformance,
                         testing::Values(Backend::kEmulator, Backend::kNetem),
                         [](const auto& back_end) {
                           return back_end.param == Backend::kNetem ? "Netem" : "Emulator";
                         });

}  // namespace
}  // namespace interneuron::netns::conformance_test
