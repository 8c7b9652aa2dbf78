// Which NICs become links of a node, when, and what is said when none does.
#include "node/loop/link_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sys/syscall.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <functional>

#include "lab/sim/trust.h"
#include "node/io/open_transport.h"
#include "node/io/steady_clock.h"
#include "node/io/udp_socket.h"
#include "tests/node/io/namespace.h"
#include "tests/node/io/support.h"

namespace interneuron::link_set_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::StartsWith;

// Notes what it is told.
class Notes : public LinkSet::User {
 public:
  void link_opened(LinkSet::Link& link) override { add("opened ", link.options.id); }
  void link_closing(LinkSet::Link& link) override {
    EXPECT_TRUE(link.transport);
    add("closing ", link.options.id);
  }
  void nic_changed(const NicChanged& change) override {
    if (change.is_warning) warnings_ += change.reason + "; ";
    add(change.nic + " " + std::string(to_string(change.to)) + " ", change.link);
  }
  std::string take() { return std::exchange(text_, {}); }
  const std::string& warnings() const { return warnings_; }

 private:
  void add(const std::string& what, LinkId id) { text_ += what + std::to_string(id.value) + "; "; }
  std::string text_;
  std::string warnings_;
};

NodeOptions with_rule(std::string pattern, std::string peer = "") {
  NodeOptions options;
  options.insecure = true;
  options.rules = {{.pattern = std::move(pattern), .traits = {}, .peer = std::move(peer)}};
  return options;
}

std::string error_of(const NodeOptions& options) {
  const std::size_t before = io::open_descriptors();
  try {
    Node node(options);
    return "no error";
  } catch (const std::exception& error) {
    if (io::open_descriptors() != before) return "left open after: " + std::string(error.what());
    return error.what();
  }
}

// Until the condition holds; NICs take a moment.
bool update_until(LinkSet& links, const std::function<bool()>& condition) {
  for (int i = 0; i < 200 && !condition(); ++i) {
    pollfd item{.fd = links.native_handle(), .events = POLLIN, .revents = 0};
    ::poll(&item, 1, 100);
    links.update(io::now());
  }
  return condition();
}

bool plug(const std::string& nic, const std::string& address) {
  return io::shell("ip link add " + nic + " type veth peer name p" + nic) &&
         io::shell("ip addr add " + address + " dev " + nic) &&
         io::shell("ip link set dev p" + nic + " up") &&
         io::shell("ip link set dev " + nic + " up");
}

TEST(LinkSet, ARuleThatIsNoneIsNamed) {
  EXPECT_EQ(error_of(with_rule("")), "an empty name of a network card");
  EXPECT_THAT(error_of(with_rule("mac:02")), HasSubstr("no hardware address"));
  EXPECT_THAT(error_of(with_rule("w*", "road:1")), HasSubstr("\"road:1\" of w* is not like"));
}

TEST(LinkSet, WhatMatchesNothingIsToldWithTheCardsThatExist) {
  EXPECT_THAT(error_of(with_rule("nosuch0")), StartsWith("no network card named nosuch0; there "));
  EXPECT_THAT(error_of(with_rule("nosuch*")),
              StartsWith("no network card matches nosuch*; there "));
  EXPECT_THAT(error_of(with_rule("kind:nosuch")), HasSubstr("lo (loopback)"));
}

TEST(LinkSet, CardsThatCannotBeUsedAreToldWithTheReasons) {
  io::in_namespace([] {
    if (!io::shell("ip link set va down")) GTEST_SKIP() << "this kernel lacks what the test needs";
    NodeOptions options;
    options.insecure = true;
    options.links = {{.id = LinkId{0}, .nic = "va", .peer = "10.99.0.2:9"},
                     {.id = LinkId{1}, .nic = "vb"}};
    EXPECT_EQ(error_of(options),
              "no network card can be used: va: administratively down; vb: no carrier");
    options.links = {{.id = LinkId{0}, .nic = "lo", .peer = "198.51.100.1:9"}};
    options.insecure = false;
    options.security = sim::security_of(1, {2});
    EXPECT_EQ(error_of(options),
              "no network card can be used: lo: nothing routes to 198.51.100.1 "
              "through it");
  });
}

TEST(LinkSet, CardsOfARuleThatAllLackAPrivilegeSaySoByTheirCode) {
  io::in_namespace([] {
    __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
    __user_cap_data_struct none[_LINUX_CAPABILITY_U32S_3]{};
    ASSERT_EQ(::syscall(SYS_capset, &header, none), 0);
    // Only va has an address, and is tried.
    NodeOptions options = with_rule("v*");
    options.transport = TransportKind::kRing;
    Notes notes;
    try {
      const LinkSet links(options, notes);
      ADD_FAILURE() << "no error";
    } catch (const IoError& error) {
      EXPECT_EQ(error.code(), EPERM) << error.what();
      EXPECT_THAT(error.what(), HasSubstr("va: not permitted to open a packet socket"));
    }
  });
}

TEST(LinkSet, ANamedCardMayBecomeReadyLater) {
  io::in_namespace([] {
    if (!io::shell("ip link set va down")) GTEST_SKIP() << "this kernel lacks what the test needs";
    NodeOptions options;
    options.links = {{.id = LinkId{4}, .nic = "va", .peer = "10.99.0.2:9"},
                     {.id = LinkId{5}, .nic = "lo"}};
    Notes notes;
    LinkSet links(options, notes);
    EXPECT_EQ(links.find(LinkId{4})->transport, nullptr) << "va waits";
    EXPECT_NE(links.find(LinkId{5})->transport, nullptr) << "lo is open";
    EXPECT_EQ(notes.take(), "");
    io::shell("ip link set va up");
    if (!update_until(links, [&] { return links.find(LinkId{4})->transport != nullptr; })) {
      FAIL() << "va is opened";
    }
    EXPECT_EQ(notes.take(), "va ready 4; opened 4; ");
  });
}

TEST(LinkSet, WhatACardThatComesLaterBypassesIsTold) {
  io::in_namespace([] {
    NodeOptions options;
    options.links = {{.id = LinkId{4}, .nic = "va", .peer = "10.99.0.2:9"}};
    options.rules = {{.pattern = "new*", .traits = {}, .peer = "10.95.0.2:9"}};
    options.transport = TransportKind::kRing;
    Notes notes;
    LinkSet links(options, notes);
    EXPECT_EQ(links.warnings().size(), 1U);
    ASSERT_TRUE(plug("new0", "10.95.0.1/24"));
    EXPECT_TRUE(update_until(links, [&] {
      return notes.warnings().find("new0 (port") != std::string::npos;
    })) << notes.warnings();
    EXPECT_THAT(notes.warnings(), HasSubstr("bypass nftables"));
  });
}

TEST(LinkSet, CardsThatMatchARuleComeAndGoWithTheSmallestFreeIds) {
  io::in_namespace([] {
    NodeOptions options = with_rule("wan*");
    options.links = {{.id = LinkId{1}, .nic = "lo"}};
    options.rules[0].traits.metered = true;
    Notes notes;
    LinkSet links(options, notes);
    const auto open = [&](LinkId id) {
      const auto* link = links.find(id);
      return link != nullptr && link->transport != nullptr;
    };
    if (!plug("wan0", "10.1.0.1/24") || !update_until(links, [&] { return open(LinkId{0}); })) {
      FAIL() << "wan0 is link 0";
    }
    if (!plug("wan1", "10.1.1.1/24") || !update_until(links, [&] { return open(LinkId{2}); })) {
      FAIL() << "wan1 is link 2";
    }
    EXPECT_TRUE(links.find(LinkId{0})->info.traits.metered) << "the rule's traits";
    notes.take();
    io::shell("ip link del wan0");
    if (!update_until(links, [&] { return links.find(LinkId{0}) == nullptr; })) {
      FAIL() << "link 0 is gone";
    }
    EXPECT_EQ(notes.take(), "closing 0; wan0 absent 0; ");
    if (!plug("wan7", "10.1.7.1/24") || !update_until(links, [&] { return open(LinkId{0}); })) {
      FAIL() << "wan7 is link 0";
    }
    EXPECT_EQ(links.links().size(), 3) << "three links";
  });
}

TEST(LinkSet, ARenamedCardFollowsTheRuleOfItsName) {
  io::in_namespace([] {
    NodeOptions options = with_rule("wan*");
    options.links = {{.id = LinkId{0}, .nic = "lo"}};
    Notes notes;
    LinkSet links(options, notes);
    io::shell("ip link set va down");
    io::shell("ip link set va name wan0");
    io::shell("ip link set wan0 up");
    const auto opened = [&] {
      const auto* link = links.find(LinkId{1});
      return link != nullptr && link->transport != nullptr;
    };
    EXPECT_TRUE(update_until(links, opened)) << "wan0 is a link";
    io::shell("ip link set wan0 down");
    io::shell("ip link set wan0 name va");
    EXPECT_TRUE(update_until(links, [&] { return links.links().size() == 1; })) << "va is none";
  });
}

TEST(LinkSet, ByKindAndByHardwareAddress) {
  io::in_namespace([] {
    if (!io::shell("ip link set vb address 02:00:00:00:00:0b")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    Notes notes;
    LinkSet by_kind(with_rule("kind:veth"), notes);
    NodeOptions options = with_rule("mac:02:00:00:00:00:0B");
    options.links = {{.id = LinkId{0}, .nic = "lo"}};
    LinkSet by_mac(options, notes);
    EXPECT_EQ(by_kind.links().size(), 2) << "both ends";
    EXPECT_EQ(by_mac.find(LinkId{1})->options.nic, "vb") << "vb";
  });
}

// "12": the number of the XDP program on a card; empty: there is none.
std::string program_on(const std::string& nic) {
  const std::string command = "PATH=$PATH:/sbin:/usr/sbin; ip link show " + nic +
                              " | sed -n 's,.*prog/xdp id \\([0-9]*\\).*,\\1,p'";
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), &::pclose);
  std::array<char, 32> text{};
  if (!pipe || std::fgets(text.data(), text.size(), pipe.get()) == nullptr) return {};
  return text.data();
}

bool may_use_xdp() {
  try {
    io::require_privilege(TransportKind::kXdp);
    return true;
  } catch (const IoError&) {
    return false;
  }
}

TEST(LinkSet, ACardThatIsResetWithEachProgramComesToRest) {
  if (!may_use_xdp()) GTEST_SKIP() << "needs root of the host, for XDP";
  io::in_namespace(
      [] {
        NodeOptions options;
        options.links = {{.id = LinkId{0}, .nic = "va"}};
        options.transport = TransportKind::kXdp;
        Notes notes;
        LinkSet links(options, notes);
        auto& va = *links.find(LinkId{0});
        std::string program = program_on("va");
        ASSERT_NE(program, "");
        // As igb and igc do: the carrier is away for a while.
        const auto reset = [&] {
          return io::shell("ip link set vb down") &&
                 update_until(links, [&] { return va.state == NicState::kNoCarrier; }) &&
                 !va.transport && io::shell("ip link set vb up") &&
                 update_until(links, [&] { return va.transport != nullptr; });
        };
        ASSERT_TRUE(reset());
        EXPECT_EQ(notes.take(), "closing 0; va no_carrier 0; va ready 0; opened 0; ");
        EXPECT_EQ(program_on("va"), program) << "reset again";
        // What does not fit any more is closed in earnest.
        ASSERT_TRUE(io::shell("ip link set va down"));
        ASSERT_TRUE(update_until(links, [&] { return va.state == NicState::kNoCarrier; }));
        EXPECT_EQ(program_on("va"), program);
        ASSERT_TRUE(io::shell("ip link set va mtu 1300"));
        EXPECT_TRUE(update_until(links, [&] { return va.aside == nullptr; }));
        EXPECT_EQ(program_on("va"), "");
      },
      io::Root::kOfHost);
}

TEST(LinkSet, ThePortStaysTheSameAcrossIncarnations) {
  io::in_namespace([] {
    NodeOptions options;
    options.links = {{.id = LinkId{0}, .nic = "va"}, {.id = LinkId{1}, .nic = "lo"}};
    Notes notes;
    LinkSet links(options, notes);
    auto& va = *links.find(LinkId{0});
    const std::uint16_t port = port_of(va.transport->local_address());
    io::shell("ip link set va down");
    ASSERT_TRUE(update_until(links, [&] { return !va.transport; })) << "closed";
    io::shell("ip link set va up");
    if (!update_until(links, [&] { return va.transport != nullptr; })) {
      FAIL() << "opened again";
    }
    EXPECT_EQ(port_of(va.transport->local_address()), port) << "the same port";
    // Unless somebody else took it meanwhile.
    io::shell("ip link set va down");
    update_until(links, [&] { return !va.transport; });
    const io::UdpTransport other({.nic = "lo", .local = *make_address("0.0.0.0", port)});
    const io::UdpTransport same({.nic = "va", .local = *make_address("0.0.0.0", port)});
    io::shell("ip link set va up");
    EXPECT_TRUE(update_until(links, [&] { return va.transport != nullptr; })) << "opened";
    EXPECT_NE(port_of(va.transport->local_address()), port) << "another port";
  });
}

TEST(LinkSet, APublicAddressThatComesLaterIsNotServed) {
  io::in_namespace([] {
    NodeOptions options;
    options.links = {{.id = LinkId{0}, .nic = "va"}, {.id = LinkId{1}, .nic = "lo"}};
    options.accept_peers = true;
    Notes notes;
    LinkSet links(options, notes);
    auto& va = *links.find(LinkId{0});
    ASSERT_TRUE(va.transport) << "va is open";
    io::shell("ip addr add 203.0.113.5/24 dev va");
    ASSERT_TRUE(update_until(links, [&] { return !va.transport; })) << "closed";
    EXPECT_TRUE(va.reason.starts_with("va has the public address 203.0.113.5")) << va.reason;
    io::shell("ip addr del 203.0.113.5/24 dev va");
    EXPECT_TRUE(update_until(links, [&] { return va.transport != nullptr; }))
        << "open again when it is gone";
  });
}

TEST(LinkSet, ALinkWithALocalAddressWaitsForIt) {
  io::in_namespace([] {
    if (!io::shell("ip addr add 10.99.0.5/24 dev va")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    NodeOptions options;
    options.links = {{.id = LinkId{0}, .nic = "va", .local_address = "10.99.0.5"},
                     {.id = LinkId{1}, .nic = "lo"}};
    Notes notes;
    LinkSet links(options, notes);
    auto& va = *links.find(LinkId{0});
    ASSERT_TRUE(va.transport) << "va is open";
    io::shell("ip addr del 10.99.0.5/24 dev va");
    ASSERT_TRUE(update_until(links, [&] { return !va.transport; })) << "closed";
    EXPECT_TRUE(va.reason.starts_with("10.99.0.5 is no address of va")) << va.reason;
    io::shell("ip addr add 10.99.0.5/24 dev va");
    EXPECT_TRUE(update_until(links, [&] { return va.transport != nullptr; })) << "open";
  });
}

TEST(LinkSet, WhereOnlyARuleForTheSourceRoutesTheSocketIsBoundToIt) {
  io::in_namespace([] {
    if (!io::shell("ip route add default via 10.99.0.2 dev va table 101") ||
        !io::shell("ip rule add from 10.99.0.1 lookup 101")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    NodeOptions options;
    options.links = {{.id = LinkId{0}, .nic = "va", .peer = "198.51.100.1:9"},
                     {.id = LinkId{1}, .nic = "lo"}};
    Notes notes;
    LinkSet links(options, notes);
    const auto& va = *links.find(LinkId{0});
    ASSERT_TRUE(va.transport) << va.reason;
    EXPECT_TRUE(to_string(va.transport->local_address()).starts_with("10.99.0.1:")) << "bound";
  });
}

TEST(Statistics, AreToldAtIntervals) {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{3}, .nic = "lo"}};
  Node node(options);
  EXPECT_THROW(node.on_statistics(Duration::zero(), [](const Statistics&) {}),
               std::invalid_argument);
  std::vector<Statistics> told;
  node.on_statistics(milliseconds(10), [&](const Statistics& statistics) {
    told.push_back(statistics);
    if (told.size() == 3) node.stop();
  });
  node.after(seconds(60), [] { throw std::runtime_error("the test took too long"); });
  node.run();
  ASSERT_EQ(told.size(), 3u);
  EXPECT_GE(told[2].at - told[0].at, milliseconds(10));
  ASSERT_EQ(told[0].links.size(), 1u);
  EXPECT_EQ(told[0].links[0].id, LinkId{3});
  EXPECT_EQ(told[0].links[0].nic, "lo");
  EXPECT_EQ(told[0].links[0].nic_state, NicState::kReady);
  EXPECT_EQ(told[0].links[0].reason, "ready with address 127.0.0.1");
}

}  // namespace
}  // namespace interneuron::link_set_test
