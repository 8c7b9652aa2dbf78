// What the monitor says when a network card of one's own is plugged, unplugged, renamed, moved, …,
// and how soon: everything within 200 ms of the moment at which the command that does it is done.
#include "node/monitor/link_monitor.h"

#include <gtest/gtest.h>

#include "watch.h"

namespace interneuron::io::link_monitor_test {
namespace {

using enum NicState;

// Runs `body` in a namespace of its own, with a monitor by which the card "va" is ready.
void with_ready_card(void (*body)(Watch&)) {
  in_namespace([body] {
    Watch watch;
    ASSERT_TRUE(wait_until_ready(watch)) << "va is ready";
    body(watch);
  });
}

TEST(LinkMonitor, TheLoopbackCardIsReadyForItsOwnAddresses) {
  LinkMonitor monitor;
  monitor.require_route("lo", *parse_address("127.0.0.2:9"));
  EXPECT_EQ(monitor.state("lo"), kReady) << monitor.reason("lo");
  monitor.require_route("lo", Address{});
  EXPECT_EQ(monitor.state("lo"), kReady) << monitor.reason("lo");
  monitor.require_route("lo", *parse_address("198.51.100.1:9"));
  EXPECT_EQ(monitor.state("lo"), kNoRoute);
  EXPECT_EQ(monitor.reason("lo"), "nothing routes to 198.51.100.1 through it");
  ASSERT_NE(monitor.find("lo"), nullptr);
  EXPECT_EQ(monitor.find("lo")->kind, "loopback");
  EXPECT_EQ(monitor.find("lo")->operstate, "unknown");
}

TEST(LinkMonitor, ANameWithoutACardIsAbsent) {
  LinkMonitor monitor;
  EXPECT_EQ(monitor.find("nosuch0"), nullptr);
  EXPECT_EQ(monitor.state("nosuch0"), kAbsent);
  EXPECT_EQ(monitor.reason("nosuch0"), "there is no network card of this name");
  monitor.require_route("nosuch0", kPeer);
  EXPECT_EQ(monitor.state("nosuch0"), kAbsent);
}

TEST(LinkMonitor, WhatTheKernelKnowsOfACard) {
  in_namespace([] {
    if (!shell("ip link set va address 02:00:00:00:00:0a mtu 1450")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    Watch watch;
    ASSERT_TRUE(wait_until_ready(watch)) << "va is ready";
    const Nic* va = watch.monitor.find("va");
    EXPECT_EQ(va->kind, "veth") << "kind and driver";
    EXPECT_EQ(va->driver, "veth") << "kind and driver";
    EXPECT_EQ(va->mac, "02:00:00:00:00:0a") << "the hardware address";
    EXPECT_EQ(va->mtu, 1450) << "the MTU";
    EXPECT_EQ(va->operstate, "up") << "operstate";
    EXPECT_TRUE(va->admin_up) << "up";
    EXPECT_TRUE(va->carrier) << "up";
    EXPECT_TRUE(va->up) << "up";
    EXPECT_EQ(va->addresses.front(), *make_address("10.99.0.1", 0)) << "the address";
    EXPECT_EQ(find_nic("va")->index, va->index) << "the same as when asked once";
    EXPECT_EQ(watch.monitor.nics().front().name, "lo") << "by index";
  });
}

TEST(LinkMonitor, DownUpAndCarrier) {
  with_ready_card([](Watch& watch) {
    expect_event(watch.after("ip link set va down", "va", kNoCarrier), kReady, false,
                 "administratively down");
    expect_event(watch.after("ip link set va up", "va", kReady), kNoCarrier, false,
                 "ready with address 10.99.0.1");
    expect_event(watch.after("ip link set vb down", "va", kNoCarrier), kReady, false, "no carrier");
    expect_event(watch.after("ip link set vb up", "va", kReady), kNoCarrier, false,
                 "ready with address 10.99.0.1");
  });
}

TEST(LinkMonitor, AddressesAndMtu) {
  with_ready_card([](Watch& watch) {
    expect_event(watch.after("ip addr add 10.99.1.1/24 dev va", "va", kReady), kReady, false,
                 "address 10.99.1.1 was added");
    expect_event(watch.after("ip addr del 10.99.1.1/24 dev va", "va", kReady), kReady, false,
                 "address 10.99.1.1 is gone");
    expect_event(watch.after("ip addr del 10.99.0.1/24 dev va", "va", kNoAddress), kReady, false,
                 "address 10.99.0.1 is gone");
    expect_event(watch.after("ip addr add 10.99.0.3/24 dev va", "va", kReady), kNoAddress, true,
                 "ready with address 10.99.0.3");
    expect_event(watch.after("ip link set va mtu 1400", "va", kReady), kReady, true,
                 "MTU 1500 became 1400");
    EXPECT_EQ(watch.monitor.find("va")->mtu, 1400) << "the MTU";
  });
}

TEST(LinkMonitor, OneAddressInPlaceOfAnotherIsANewIncarnation) {
  with_ready_card([](Watch& watch) {
    // Both changes before the monitor looks.
    shell("ip addr add 10.99.0.3/16 dev va");
    expect_event(watch.after("ip addr del 10.99.0.1/24 dev va", "va", kReady), kReady, true,
                 "address 10.99.0.1 became 10.99.0.3");
  });
}

TEST(LinkMonitor, RoutesComeAndGo) {
  with_ready_card([](Watch& watch) {
    expect_event(watch.after("ip route del 10.99.0.0/24", "va", kNoRoute), kReady, false,
                 "nothing routes to 10.99.0.2 through it");
    expect_event(watch.after("ip route add 10.0.0.0/8 dev va", "va", kReady), kNoRoute, false,
                 "ready with address 10.99.0.1");
    expect_event(watch.after("ip route add blackhole 10.99.0.2", "va", kNoRoute), kReady, false,
                 "nothing routes to 10.99.0.2 through it");
    expect_event(watch.after("ip route del blackhole 10.99.0.2", "va", kReady), kNoRoute, false,
                 "ready with address 10.99.0.1");
  });
}

TEST(LinkMonitor, ATableOfItsOwnIsARouteIfTheSourceIsItsOwn) {
  in_namespace([] {
    Watch watch;
    const Address peer = *parse_address("198.51.100.1:9");
    watch.monitor.require_route("va", peer);
    if (!watch.monitor.find("va")->up && !watch.until("va", kNoRoute)) {
      FAIL() << "va is up";
    }
    shell("ip route add default via 10.99.0.2 dev va table 101");
    expect_event(watch.after("ip rule add from 10.99.0.1 lookup 101", "va", kReady), kNoRoute, true,
                 "ready with address 10.99.0.1 as source");
    EXPECT_EQ(watch.monitor.required_source("va"), make_address("10.99.0.1", 0)) << "the source";
    // As the testbed has it: a default route for everybody beside it.
    expect_event(watch.after("ip route add default via 10.99.0.2 dev va metric 101", "va", kReady),
                 kReady, true, "it is routed by another source address");
    EXPECT_FALSE(watch.monitor.required_source("va")) << "any source";
    shell("ip route del default via 10.99.0.2 dev va metric 101");
    expect_event(watch.after("ip rule del from 10.99.0.1 lookup 101", "va", kNoRoute), kReady,
                 false, "nothing routes to 198.51.100.1 through it");
  });
}

TEST(LinkMonitor, WithoutAPeerADefaultRouteIsWanted) {
  in_namespace([] {
    Watch watch;
    if (watch.monitor.state("va") != kNoRoute && !watch.until("va", kNoRoute)) {
      FAIL() << "va has no default route";
    }
    expect_event(watch.after("ip route add default via 10.99.0.2", "va", kReady), kNoRoute, false,
                 "ready with address 10.99.0.1");
    EXPECT_EQ(watch.monitor.find("va")->gateways, std::vector{*make_address("10.99.0.2", 0)})
        << "the gateway";
    // The kernel says nothing of the routes that go now.
    expect_event(watch.after("ip link set va down", "va", kNoCarrier), kReady, false,
                 "administratively down");
    expect_event(watch.after("ip link set va up", "va", kNoRoute), kNoCarrier, false,
                 "no default route leads through it");
    EXPECT_TRUE(watch.monitor.find("va")->gateways.empty()) << "no gateway";
  });
}

TEST(LinkMonitor, UnplugAndPlug) {
  with_ready_card([](Watch& watch) {
    expect_event(watch.after("ip link del va", "va", kAbsent), kReady, false, "unplugged");
    EXPECT_EQ(watch.monitor.state("vb"), kAbsent) << "its peer went with it";
    shell("ip link add va type veth peer name vb");
    shell("ip link set vb up");
    ASSERT_TRUE(watch.until("va", kNoCarrier)) << "va came";
    shell("ip addr add 10.99.0.1/24 dev va");
    expect_event(watch.after("ip link set va up", "va", kReady), kNoCarrier, false,
                 "ready with address 10.99.0.1");
  });
}

TEST(LinkMonitor, AnotherCardOfTheSameNameIsANewIncarnation) {
  with_ready_card([](Watch& watch) {
    const int old_index = watch.monitor.find("va")->index;
    // All of it before the monitor looks.
    const auto replace = [] {
      return shell("ip link del va") && shell("ip link add va type veth peer name vb") &&
             shell("ip addr add 10.99.0.1/24 dev va") && shell("ip link set vb up") &&
             shell("ip link set va up");
    };
    const auto event = watch.after(replace, "another va", "va", kReady);
    ASSERT_TRUE(event) << "an event";
    EXPECT_TRUE(event->new_incarnation) << "a new incarnation";
    EXPECT_NE(event->index, old_index) << "another index";
    EXPECT_TRUE(event->reason.starts_with("another network card of the same name")) << "the reason";
  });
}

TEST(LinkMonitor, Rename) {
  with_ready_card([](Watch& watch) {
    watch.monitor.require_route("wan0", kPeer);
    // A card that is up has to be taken down for it, unless the kernel is 6.3 or newer.
    shell("ip link set va down");
    watch.until("va", kNoCarrier);
    expect_event(watch.after("ip link set va name wan0", "va", kAbsent), kNoCarrier, false,
                 "renamed to wan0");
    EXPECT_EQ(watch.monitor.reason("wan0"), "renamed from va; administratively down")
        << "where it comes from";
    expect_event(watch.after("ip link set wan0 up", "wan0", kReady), kNoCarrier, false,
                 "ready with address 10.99.0.1");
  });
}

TEST(LinkMonitor, WhatWasRequiredFollowsACardThatIsRenamed) {
  with_ready_card([](Watch& watch) {
    shell("ip link set va down");
    watch.until("va", kNoCarrier);
    const auto event = watch.after("ip link set va name wan0", "wan0", kNoCarrier);
    ASSERT_TRUE(event) << "an event";
    EXPECT_EQ(event->former_name, "va");
    EXPECT_FALSE(event->new_incarnation);
    EXPECT_EQ(event->reason, "renamed from va");
    EXPECT_EQ(watch.monitor.state("va"), kAbsent);
    expect_event(watch.after("ip link set wan0 up", "wan0", kReady), kNoCarrier, false,
                 "ready with address 10.99.0.1");
  });
}

TEST(LinkMonitor, MovedAwayAndBack) {
  in_namespace([] {
    const OtherNamespace other;
    Watch watch;
    if (!other.made()) GTEST_SKIP() << "this kernel lacks what the test needs";
    ASSERT_TRUE(wait_until_ready(watch)) << "va is ready";
    expect_event(watch.after([&] { return other.take("va"); }, "moving va", "va", kAbsent), kReady,
                 false, "moved to another network namespace");
    expect_event(
        watch.after([&] { return other.give_back("va"); }, "moving va back", "va", kNoCarrier),
        kAbsent, true, "administratively down");
    shell("ip addr add 10.99.0.1/24 dev va");
    expect_event(watch.after("ip link set va up", "va", kReady), kNoCarrier, false,
                 "ready with address 10.99.0.1");
  });
}

TEST(LinkMonitor, Ipv6AddressesCountWhenTheyMayBeUsed) {
  in_namespace([] {
    if (!shell("ip -6 addr add fd00::2/64 dev vb nodad")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    Watch watch;
    watch.monitor.require_route("va", *parse_address("[fd00::2]:9"));
    if (watch.monitor.state("va") != kNoAddress && !watch.until("va", kNoAddress)) {
      FAIL() << "va waits for an address";
    }
    // Tentative until nobody has answered for it, a second or two. A link-local address that comes
    // meanwhile does not count.
    shell("ip -6 addr add fd00::1/64 dev va");
    watch.monitor.update();
    EXPECT_EQ(watch.monitor.state("va"), kNoAddress) << "a tentative address does not count";
    expect_event(watch.until("va", kReady), kNoAddress, false, "ready with address fd00::1");
    expect_event(watch.after("ip -6 addr del fd00::1/64 dev va", "va", kNoAddress), kReady, false,
                 "address fd00::1 is gone");
    expect_event(watch.after("ip -6 addr add fd00::5/64 dev va nodad", "va", kReady), kNoAddress,
                 true, "ready with address fd00::5");
    // Down takes IPv6 addresses away, up does not bring them back.
    expect_event(watch.after("ip link set va down", "va", kNoCarrier), kReady, false,
                 "administratively down");
    expect_event(watch.after("ip link set va up", "va", kNoAddress), kNoCarrier, false,
                 "address fd00::5 is gone");
  });
}

TEST(LinkMonitor, LinkLocalAddressesReachLinkLocalPeers) {
  in_namespace([] {
    Watch watch;
    const auto peer = parse_address("[fe80::2%va]:9");
    if (!peer) GTEST_SKIP() << "this kernel lacks what the test needs";
    watch.monitor.require_route("va", *peer);
    if (watch.monitor.state("va") != kReady && !watch.until("va", kReady)) {
      FAIL() << "ready for a link-local peer";
    }
    watch.monitor.require_route("va", *parse_address("[fd00::2]:9"));
    EXPECT_EQ(watch.monitor.state("va"), kNoAddress) << "not for another";
    EXPECT_EQ(watch.monitor.reason("va"), "no IPv6 address") << "the reason";
  });
}

}  // namespace
}  // namespace interneuron::io::link_monitor_test
