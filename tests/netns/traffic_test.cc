// What passes through a testbed, and how it is counted.
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>

#include <cstring>
#include <numeric>
#include <vector>

#include "netns/state/snapshot.h"
#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::traffic_test {
namespace {

#ifndef UDP_SEGMENT
constexpr int UDP_SEGMENT = 103;  // linux/udp.h, which clashes with netinet/udp.h
#endif

std::vector<char> pattern(std::size_t size, int start) {
  std::vector<char> out(size);
  std::iota(out.begin(), out.end(), static_cast<char>(start));
  return out;
}

std::vector<char> receive(int fd) {
  std::vector<char> out(2000);
  if (!readable(fd)) return {};
  const ssize_t count = ::recv(fd, out.data(), out.size(), 0);
  out.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  return out;
}

// A counter of /proc/net/snmp of one side, e.g. "Udp", "InCsumErrors".
long counter(const State& state, Host host, const std::string& protocol, const std::string& name) {
  const std::string script =
      "awk '$1==\"" + protocol + ":\" {if (!seen++) {for (i=2;i<=NF;i++) if ($i==\"" + name +
      "\") column=i} else exit $column > 100 ? 100 : $column}' /proc/net/snmp";
  return Testbed::run_in(state, host, {"sh", "-c", script});
}

class TrafficTest : public NetnsTest {};

TEST_F(TrafficTest, DatagramsPassBothWaysOnEveryLinkUnchanged) {
  TestbedOptions options = clean_options(dir_);
  options.scenario = scenario_of({"a=clean", "b=clean", "c=clean"}, 1);
  const Testbed testbed = Testbed::up(options);
  for (std::size_t i = 0; i < 3; ++i) {
    const UdpPair sockets = udp_pair(testbed.state(), i);
    for (const std::size_t size : {1U, 17U, 1400U, 1472U}) {
      const auto up = pattern(size, static_cast<int>(i));
      ASSERT_EQ(::send(sockets.vehicle.get(), up.data(), size, 0), static_cast<ssize_t>(size));
      EXPECT_EQ(receive(sockets.road.get()), up) << size;
      const auto down = pattern(size, static_cast<int>(i) + 100);
      ASSERT_EQ(::send(sockets.road.get(), down.data(), size, 0), static_cast<ssize_t>(size));
      EXPECT_EQ(receive(sockets.vehicle.get()), down) << size;
    }
    // A packet is counted after it has left.
    EXPECT_TRUE(eventually([&] { return testbed.snapshot().links.at(i).down.packets_in >= 4; }));
    const LinkSnapshot link = testbed.snapshot().links.at(i);
    EXPECT_EQ(link.up.packets_in, 4U);
    EXPECT_EQ(link.down.bytes_in, 1U + 17U + 1400U + 1472U + 4U * 28U);  // IP bytes
  }
  EXPECT_EQ(counter(testbed.state(), kRoad, "Udp", "InCsumErrors"), 0);
  EXPECT_EQ(counter(testbed.state(), kVehicle, "Udp", "InCsumErrors"), 0);
}

TEST_F(TrafficTest, SegmentationOffloadArrivesAsSinglePacketsWithRightChecksums) {
  const Testbed testbed = Testbed::up(clean_options(dir_));
  const UdpPair sockets = udp_pair(testbed.state());
  const int segment = 1400;
  ASSERT_EQ(::setsockopt(sockets.vehicle.get(), IPPROTO_UDP, UDP_SEGMENT, &segment, sizeof segment),
            0);
  const auto sent = pattern(20 * 1400 + 99, 3);
  ASSERT_EQ(::send(sockets.vehicle.get(), sent.data(), sent.size(), 0),
            static_cast<ssize_t>(sent.size()))
      << std::strerror(errno);
  std::vector<char> received;
  for (int i = 0; i < 21; ++i) {
    const auto part = receive(sockets.road.get());
    EXPECT_EQ(part.size(), i < 20 ? 1400U : 99U);
    received.insert(received.end(), part.begin(), part.end());
  }
  EXPECT_EQ(received, sent);
  // The link saw packets, not one big one, or its rate and its queue would be a fiction.
  EXPECT_EQ(testbed.snapshot().links.at(0).up.packets_in, 21U);
  EXPECT_EQ(counter(testbed.state(), kRoad, "Udp", "InCsumErrors"), 0);
}

TEST_F(TrafficTest, TimeStartsWithTheFirstPacketOnAnyLink) {
  TestbedOptions options = clean_options(dir_);
  options.scenario = default_scenario();
  const Testbed testbed = Testbed::up(options);
  const UdpPair sockets = udp_pair(testbed.state(), 1);
  EXPECT_FALSE(testbed.snapshot().epoch.has_value());
  EXPECT_EQ(testbed.snapshot().links.at(0).up.packets_in, 0U);

  const auto before = std::chrono::steady_clock::now().time_since_epoch();
  ASSERT_EQ(::send(sockets.vehicle.get(), "x", 1, 0), 1);
  ASSERT_TRUE(eventually([&] { return testbed.snapshot().epoch.has_value(); }));
  const auto after = std::chrono::steady_clock::now().time_since_epoch();
  const Duration epoch = testbed.snapshot().epoch->time_since_epoch();
  // The emulator converts the kernel's wall-clock time of arrival, to within what reading two
  // clocks takes.
  EXPECT_GE(epoch, before - std::chrono::microseconds(200));
  EXPECT_LE(epoch, after);
  ASSERT_EQ(::send(sockets.vehicle.get(), "x", 1, 0), 1);
  ASSERT_TRUE(eventually([&] { return testbed.snapshot().links.at(1).up.packets_in == 2; }));
  EXPECT_EQ(testbed.snapshot().epoch->time_since_epoch(), epoch);
}

TEST_F(TrafficTest, DropsAtTheTailOfTheQueueOnly) {
  TestbedOptions options = clean_options(dir_);
  options.scenario.links[0].profile.up = {.rate = DataRate::mbit(1), .queue_bytes = 15'000};
  const Testbed testbed = Testbed::up(options);
  const UdpPair sockets = udp_pair(testbed.state());
  const auto datagram = pattern(1472, 0);
  constexpr std::uint64_t kSent = 100;  // 1.2 s at this rate; the queue takes 10 packets
  for (std::uint64_t i = 0; i < kSent; ++i) {
    ASSERT_EQ(::send(sockets.vehicle.get(), datagram.data(), datagram.size(), 0), 1472);
  }
  const auto up = [&] { return testbed.snapshot().links.at(0).up; };
  ASSERT_TRUE(eventually([&] { return up().packets_in == kSent; }));
  EXPECT_GE(up().queue_drops, 88U);
  EXPECT_LE(up().queue_drops, 90U);
  ASSERT_TRUE(eventually([&] { return up().delivered + up().queue_drops == kSent; }));
  EXPECT_EQ(up().lost, 0U);
  EXPECT_EQ(testbed.snapshot().kernel_drops, 0U);
}

TEST_F(TrafficTest, ANicThatGoesDownAndUpCarriesAgain) {
  const Testbed testbed = Testbed::up(clean_options(dir_));
  const State& state = testbed.state();
  if (Testbed::run_in(state, kVehicle, {"sh", "-c", "command -v ip >/dev/null"}) != 0) {
    GTEST_SKIP() << "no program `ip`";
  }
  const UdpPair sockets = udp_pair(state);
  ASSERT_EQ(Testbed::run_in(state, kVehicle, {"ip", "link", "set", "ifclean", "down"}), 0);
  ASSERT_EQ(::send(sockets.road.get(), "lost", 4, 0), 4);
  ASSERT_EQ(Testbed::run_in(state, kVehicle, {"ip", "link", "set", "ifclean", "up"}), 0);
  // Until the carrier is back (the kernel delays that) sending fails or is in vain.
  ASSERT_TRUE(eventually([&] {
    ::send(sockets.vehicle.get(), "back", 4, 0);
    return readable(sockets.road.get(), 50);
  }));
}

}  // namespace
}  // namespace interneuron::netns::traffic_test
