// What only AF_XDP has to do: cards with several receive queues, what is left to the kernel, and
// errors.
#include "host/io/xdp_transport.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sys/syscall.h>

#include "host/io/udp_transport.h"
#include "transport_conformance.h"

namespace interneuron::io {
namespace {

void as_root(const std::function<void()>& body) {
  if (!may_use_xdp()) GTEST_SKIP() << "needs root of the host, for XDP";
  in_namespace(body, Root::kOfHost);
}

// What a constructor says; empty: nothing.
std::string refusal(const UdpOptions& options, int code) {
  try {
    const XdpTransport transport(options);
    return {};
  } catch (const IoError& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
    return error.what();
  }
}

TEST(XdpTransport, HearsAllReceiveQueuesOfACard) {
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

TEST(XdpTransport, LeavesToTheKernelWhatIsNotForIt) {
  as_root([] {
    TwoHosts hosts;
    ASSERT_TRUE(hosts.made());
    const auto xdp = hosts.there(
        [] { return std::make_unique<XdpTransport>(TwoHosts::options("vb", "10.99.0.2")); });
    const std::uint16_t port = port_of(xdp->local_address());
    UdpTransport here(TwoHosts::options("va", "10.99.0.1"));
    // Another port of the same address; the same port of another address of the card.
    for (const auto& [host, at] : {std::pair{"10.99.0.2", std::uint16_t{0}}, {"10.99.0.3", port}}) {
      const auto there = hosts.there([host = host, at = at] {
        return std::make_unique<UdpTransport>(TwoHosts::options("vb", host, at));
      });
      EXPECT_TRUE(gets_through(here, there->local_address(), *there)) << host;
    }
    EXPECT_TRUE(gets_through(here, xdp->local_address(), *xdp));
    EXPECT_EQ(xdp->counters().receive_errors, 0U);
  });
}

TEST(XdpTransport, FollowsAddressesThatComeAndGo) {
  as_root([] {
    TwoHosts hosts;
    ASSERT_TRUE(hosts.made());
    const auto xdp = hosts.there(
        [] { return std::make_unique<XdpTransport>(TwoHosts::options("vb", "0.0.0.0")); });
    UdpTransport here(TwoHosts::options("va", "10.99.0.1"));
    const Address late = *make_address("10.99.0.8", port_of(xdp->local_address()));
    EXPECT_TRUE(gets_through(here, with_port(*make_address("10.99.0.3", 0), port_of(late)), *xdp));
    ASSERT_TRUE(hosts.shell_there("ip addr add 10.99.0.8/32 dev vb"));
    // It is told of the address by an event that it looks at when it is used.
    const TimePoint end = now() + kPatience;
    bool came = false;
    while (!came && now() < end) {
      here.send(to_all(late, {payload(1, 50)}));
      came = !xdp->receive().empty() || (readable(*xdp, 10) && !xdp->receive().empty());
    }
    EXPECT_TRUE(came);
  });
}

TEST(XdpTransport, OneAtATimeIsOnACard) {
  as_root([] {
    const XdpTransport first(TwoHosts::options("va", "10.99.0.1"));
    EXPECT_THAT(refusal(TwoHosts::options("va", "10.99.0.1"), EBUSY),
                testing::AllOf(testing::HasSubstr("another XDP program is on va"),
                               testing::HasSubstr("--transport ring or udp")));
  });
}

TEST(XdpTransport, RefusesCardsWithoutFramesOfEthernet) {
  as_root([] {
    EXPECT_THAT(refusal(TwoHosts::options("lo", "127.0.0.1"), EPROTONOSUPPORT),
                testing::HasSubstr("lo has no frames of Ethernet"));
  });
}

TEST(XdpTransport, NamesTheRemedyForAnMtuThatXdpDoesNotAllow) {
  as_root([] {
    ASSERT_TRUE(shell("ip link set va mtu 9000") && shell("ip link set vb mtu 9000"));
    EXPECT_THAT(refusal(TwoHosts::options("va", "10.99.0.1"), ERANGE),
                testing::AllOf(testing::HasSubstr("MTU"), testing::HasSubstr("--transport ring")));
  });
}

TEST(XdpTransport, NamesTheRemedyWithoutThePrivilege) {
  in_namespace([] {
    __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
    __user_cap_data_struct none[2]{};
    ASSERT_EQ(::syscall(SYS_capset, &header, none), 0);
    EXPECT_THAT(refusal(TwoHosts::options("va", "10.99.0.1"), EPERM),
                testing::AllOf(testing::HasSubstr("setcap cap_net_raw,cap_net_admin,cap_bpf"),
                               testing::HasSubstr("--transport udp")));
    EXPECT_THROW(XdpProgram::require_privilege(), IoError);
  });
}

TEST(XdpTransport, RootOfANamespaceIsNotEnough) {
  in_namespace([] {
    EXPECT_THAT(refusal(TwoHosts::options("va", "10.99.0.1"), EPERM),
                testing::HasSubstr("root of the host"));
  });
}

}  // namespace
}  // namespace interneuron::io
