// Receive queues of cards, of which each has an AF_XDP socket of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "host/io/xdp_transport.h"
#include "transport_conformance.h"

namespace interneuron::io {
namespace {

TEST(XdpQueues, HearsAllReceiveQueuesOfACard) {
  as_root([] {
    TwoHosts hosts;
    const bool ready =
        hosts.made() &&
        shell(
            "ip link add vc numtxqueues 3 numrxqueues 3 type veth peer name vd numtxqueues 3 "
            "numrxqueues 3") &&
        shell("ip link set vc up") && shell("ip link set vd up") &&
        shell("ip addr add 10.98.0.1/24 dev vc");
    ASSERT_TRUE(ready);
    XdpTransport xdp(TwoHosts::options("vc", "10.98.0.1"));
    // Frames of a flow come by one queue, so that many flows come by all.
    FrameAddresses addresses;
    addresses.ethernet = EthernetHeader{.to = parse_mac(find_nic("vc")->mac),
                                        .from = parse_mac(find_nic("vd")->mac)};
    addresses.to = xdp.local_address();
    const FrameSender sender("vd");
    constexpr std::uint16_t kFlows = 40;
    for (std::uint16_t flow = 0; flow < kFlows; ++flow) {
      addresses.from = *make_address("10.98.0.2", static_cast<std::uint16_t>(1000 + flow));
      ASSERT_TRUE(sender.send(whole_frame(addresses, payload(flow, 60))));
    }
    EXPECT_EQ(receive_all(xdp, kFlows).size(), kFlows);
    EXPECT_EQ(xdp.counters().receive_errors, 0U);
  });
}

// The first of two queues is free, so that the program is on the card when the second is missed.
TEST(XdpQueues, OneThatSomebodyElseHasIsWaitedForOnlyWhereThatIsAllowed) {
  as_root([] {
    ASSERT_TRUE(shell("ip link add vc numrxqueues 2 type veth peer name vd numtxqueues 2") &&
                shell("ip link set vc up") && shell("ip link set vd up") &&
                shell("ip addr add 10.98.0.1/24 dev vc"));
    UdpOptions options = TwoHosts::options("vc", "10.98.0.1");
    std::optional<XdpSocket> other(std::in_place, "vc", 1, false);
    const auto time_of_refusal = [&options] {
      const TimePoint begin = now();
      try {
        const XdpTransport transport(options);
        ADD_FAILURE() << "no error";
      } catch (const IoError& error) {
        EXPECT_EQ(error.code(), EBUSY);
        EXPECT_THAT(error.what(), testing::HasSubstr("receive queue 1 of vc is taken"));
      }
      return now() - begin;
    };
    const std::size_t before = open_descriptors();
    const Duration patient = time_of_refusal();
    options.may_wait = false;
    EXPECT_LT(time_of_refusal(), patient);
    // Nothing stays open, neither descriptors nor the first queue nor the program on the card.
    EXPECT_EQ(open_descriptors(), before);
    other.reset();
    options.may_wait = true;
    EXPECT_NO_THROW(XdpTransport{options});
  });
}

}  // namespace
}  // namespace interneuron::io
