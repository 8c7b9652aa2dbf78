// Links of a running testbed that share a bottleneck.
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <vector>

#include "netns/testbed/testbed.h"
#include "support.h"

namespace interneuron::netns::cell_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr std::size_t kPayload = 1000;
constexpr int kPackets = 15;
constexpr int kEct1 = 1;
constexpr int kCe = 3;

// Two links of 100 Mbit/s that share 1 Mbit/s upwards.
TestbedOptions shared_options(const RuntimeDir& dir) {
  TestbedOptions options = clean_options(dir);
  options.backend = Backend::kEmulator;
  options.scenario = scenario_of({"a=clean", "b=clean"}, 1);
  emu::ScenarioCell cell;
  cell.name = "town";
  cell.up.rate = DataRate::mbit(1);
  cell.up.queue_bytes = 1'000'000;
  cell.up.mark_above = milliseconds(20);
  cell.down = cell.up;
  cell.down.rate = DataRate::mbit(100);
  options.scenario.cells = {cell};
  for (emu::ScenarioLink& link : options.scenario.links) link.cell = 0;
  return options;
}

// The ECN bits of the next datagram; -1: none came.
int receive_ecn(int fd) {
  if (!readable(fd)) return -1;
  std::array<char, 2000> bytes{};
  alignas(cmsghdr) std::array<char, 64> control{};
  iovec io{bytes.data(), bytes.size()};
  msghdr message{};
  message.msg_iov = &io;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  if (::recvmsg(fd, &message, 0) <= 0) return -1;
  const cmsghdr* header = CMSG_FIRSTHDR(&message);
  return header == nullptr ? -1 : *reinterpret_cast<const unsigned char*>(CMSG_DATA(header)) & 3;
}

class CellTest : public NetnsTest {};

TEST_F(CellTest, LinksShareItsRateAndAreMarked) {
  const Testbed testbed = Testbed::up(shared_options(dir_));
  const std::array<UdpPair, 2> links{udp_pair(testbed.state(), 0), udp_pair(testbed.state(), 1)};
  const int on = 1;
  for (const UdpPair& link : links) {
    ASSERT_EQ(::setsockopt(link.vehicle.get(), IPPROTO_IP, IP_TOS, &kEct1, sizeof kEct1), 0);
    ASSERT_EQ(::setsockopt(link.road.get(), IPPROTO_IP, IP_RECVTOS, &on, sizeof on), 0);
  }
  const std::vector<char> payload(kPayload);
  const auto began = steady_clock::now();
  for (int i = 0; i < kPackets; ++i) {
    for (const UdpPair& link : links) {
      ASSERT_EQ(::send(link.vehicle.get(), payload.data(), payload.size(), 0),
                static_cast<ssize_t>(payload.size()));
    }
  }
  int marked = 0;
  for (int i = 0; i < kPackets; ++i) {
    for (const UdpPair& link : links) {
      const int ecn = receive_ecn(link.road.get());
      ASSERT_GE(ecn, kEct1);
      marked += ecn == kCe ? 1 : 0;
    }
  }
  // Each of 30 packets takes the cell 8.2 ms, after 10 ms on the link, which alone would need 3.
  EXPECT_GE(steady_clock::now() - began, milliseconds(250));
  // All but the first three waited longer than 20 ms, if they were sent at once.
  EXPECT_GE(marked, kPackets);
  EXPECT_LT(marked, 2 * kPackets);
}

TEST_F(CellTest, TellsWhatItCarriedAndHowLongItsQueueWas) {
  const Testbed testbed = Testbed::up(shared_options(dir_));
  ASSERT_EQ(testbed.snapshot().cells.size(), 1U);
  Testbed::measure_cells(testbed.state());
  const UdpPair link = udp_pair(testbed.state(), 0);
  const std::vector<char> payload(kPayload);
  for (int i = 0; i < kPackets; ++i) {
    ASSERT_EQ(::send(link.vehicle.get(), payload.data(), payload.size(), 0),
              static_cast<ssize_t>(payload.size()));
  }
  constexpr std::uint64_t kIpBytes = kPackets * (kPayload + 28);
  ASSERT_TRUE(
      eventually([&] { return testbed.snapshot().cells[0].up.bytes_delivered == kIpBytes; }));
  const CellSnapshot cell = testbed.snapshot().cells[0];
  EXPECT_EQ(cell.up.packets_in, static_cast<std::uint64_t>(kPackets));
  EXPECT_EQ(cell.up.dropped, 0U);
  EXPECT_EQ(cell.up.marked, 0U);
  // All came at once and leave within 123 ms.
  EXPECT_GT(cell.up.queue_p99, milliseconds(90));
  EXPECT_LT(cell.up.queue_p99, milliseconds(130));
  EXPECT_GT(cell.up.utilisation, 0);
  EXPECT_EQ(cell.down.packets_in, 0U);
  // From now on there was no queue.
  Testbed::measure_cells(testbed.state());
  EXPECT_TRUE(eventually([&] { return testbed.snapshot().cells[0].up.utilisation == 0; }));
}

}  // namespace
}  // namespace interneuron::netns::cell_test
