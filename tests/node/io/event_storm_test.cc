// More events than can be taken in, and other things that the monitor must make up for.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "node/io/udp_socket.h"
#include "watch.h"

namespace interneuron::io::event_storm_test {
namespace {

TEST(LinkMonitor, LostEventsAreMadeUpForByReadingEverythingAnew) {
  in_namespace([] {
    LinkMonitor monitor({.receive_buffer_bytes = 1});  // the kernel's least: two kilobytes
    monitor.require_route("va", kPeer);
    for (int i = 0; i < 20; ++i) shell("ip link add d" + std::to_string(i) + " type bridge");
    shell("ip link set va down");
    const std::vector<NicEvent> events = monitor.update();
    const auto va = std::ranges::find(events, "va", &NicEvent::nic);
    EXPECT_EQ(monitor.resyncs(), 1) << "everything was read anew";
    EXPECT_GE(events.size(), 21) << "what changed is told";
    EXPECT_NE(monitor.find("d19"), nullptr) << "a new card";
    ASSERT_NE(va, events.end()) << "va is down";
    EXPECT_EQ(va->to, NicState::kNoCarrier) << "va is down";
    EXPECT_TRUE(monitor.update().empty()) << "nothing is told twice";
  });
}

TEST(LinkMonitor, AStormLeavesTheTableAsTheKernelHasIt) {
  in_namespace([] {
    LinkMonitor monitor;
    for (int round = 0; round < 5; ++round) {
      for (int i = 0; i < 6; ++i) {
        const std::string nic = "d" + std::to_string(i);
        shell("ip link add " + nic + " type bridge");
        shell("ip addr add 10.98." + std::to_string(i) + ".1/24 dev " + nic);
        if ((i + round) % 3 == 0) shell("ip link set " + nic + " up");
        if ((i + round) % 2 == 0) shell("ip link del " + nic);
      }
      monitor.update();
    }
    const std::vector<Nic> now = list_nics();
    EXPECT_EQ(now.size(), monitor.nics().size()) << "as many cards";
    for (const Nic& nic : now) {
      const Nic* known = monitor.find(nic.name);
      ASSERT_NE(known, nullptr) << nic.name;
      EXPECT_EQ(known->index, nic.index) << nic.name;
      EXPECT_EQ(known->up, nic.up) << nic.name;
      EXPECT_EQ(known->addresses, nic.addresses) << nic.name;
    }
    EXPECT_EQ(monitor.resyncs(), 0) << "by events alone";
  });
}

TEST(LinkMonitor, UnansweredQuestionsForNeighboursAreDropped) {
  in_namespace([] {
    Watch watch;
    ASSERT_TRUE(wait_until_ready(watch)) << "va is ready";
    // Nobody is there to answer for 10.99.0.77.
    UdpTransport sender({.nic = "va", .local = *make_address("10.99.0.1", 0)});
    const Bytes bytes(10);
    const Outgoing datagram{*parse_address("10.99.0.77:9"), bytes};
    sender.send({&datagram, 1});
    EXPECT_TRUE(shell("ip neigh show dev va nud incomplete | grep -q 10.99.0.77")) << "asked";
    watch.monitor.drop_unanswered_neighbours("nosuch0");
    watch.monitor.drop_unanswered_neighbours("va");
    EXPECT_FALSE(shell("ip neigh show dev va nud incomplete | grep -q 10.99.0.77")) << "dropped";
    EXPECT_TRUE(shell("ip neigh show dev va nud permanent | grep -q 10.99.0.2"))
        << "the others stay";
  });
}

}  // namespace
}  // namespace interneuron::io::event_storm_test
