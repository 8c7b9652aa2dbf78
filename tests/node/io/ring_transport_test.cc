// What only a ring has to do: the loopback card, cards whose frames have no Ethernet header,
// tags of VLANs, filters, and errors.
#include "node/ring/ring_transport.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <linux/if_tun.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>

#include "node/io/udp_socket.h"
#include "node/ring/ring_filter.h"
#include "support.h"
#include "two_hosts.h"

namespace interneuron::io::ring_transport_test {
namespace {

// A card whose frames are IP packets: what is written to it arrives, what leaves is read.
class TunCard {
 public:
  TunCard() : device_(::open("/dev/net/tun", O_RDWR | O_CLOEXEC)) {
    ifreq request{};
    std::strncpy(request.ifr_name, "raw0", IFNAMSIZ - 1);
    request.ifr_flags = IFF_TUN | IFF_NO_PI;
    made_ = device_.get() >= 0 && ::ioctl(device_.get(), TUNSETIFF, &request) == 0 &&
            shell("ip addr add 10.97.0.1/24 dev raw0") &&
            shell("ip -6 addr add fd97::1/64 dev raw0 nodad") && shell("ip link set raw0 up");
  }
  bool made() const { return made_; }
  bool write(ByteView packet) const {
    return ::write(device_.get(), packet.data(), packet.size()) ==
           static_cast<ssize_t>(packet.size());
  }
  // The next packet that is UDP; the kernel sends some of its own.
  Bytes read_udp() const {
    for (int i = 0; i < 100; ++i) {
      Bytes packet(65536);
      const ssize_t size = ::read(device_.get(), packet.data(), packet.size());
      if (size <= 0) return {};
      packet.resize(static_cast<std::size_t>(size));
      const std::size_t protocol_at = std::to_integer<int>(packet[0]) >> 4 == 4 ? 9 : 6;
      if (packet.size() > protocol_at && packet[protocol_at] == std::byte{17}) return packet;
    }
    return {};
  }

 private:
  FileDescriptor device_;
  bool made_ = false;
};

TEST(RingTransport, SpeaksWithAModemThatHasNoEthernetHeaders) {
  for (const bool ipv6 : {false, true}) {
    in_namespace([ipv6] {
      const TunCard card;
      if (!card.made()) GTEST_SKIP() << "needs /dev/net/tun";
      RingTransport ring(TwoHosts::options("raw0", ipv6 ? "fd97::1" : "10.97.0.1"));
      const Address peer = *make_address(ipv6 ? "fd97::2" : "10.97.0.2", 4711);
      // Out: two of equal size leave together and are segmented on the way, checksums complete.
      const std::vector<Bytes> sent = {payload(1, 700), payload(2, 700)};
      EXPECT_EQ(ring.send(to_all(peer, sent)).taken, 2U);
      for (const Bytes& bytes : sent) {
        const Bytes packet = card.read_udp();
        const auto parsed = parse_frame(packet, {.ethernet = false});
        ASSERT_TRUE(std::holds_alternative<ParsedFrame>(parsed))
            << name_of(std::get<FrameProblem>(parsed));
        const ParsedFrame& frame = std::get<ParsedFrame>(parsed);
        EXPECT_EQ(to_string(frame.from), to_string(ring.local_address()));
        EXPECT_EQ(to_string(frame.to), to_string(peer));
        EXPECT_EQ(Bytes(frame.payload.begin(), frame.payload.end()), bytes);
      }
      // In, and something broken before it.
      FrameAddresses addresses{.from = peer, .to = ring.local_address()};
      Bytes broken = whole_frame(addresses, payload(3, 80));
      broken.back() ^= std::byte{1};
      ASSERT_TRUE(card.write(broken));
      ASSERT_TRUE(card.write(whole_frame(addresses, payload(4, 90))));
      EXPECT_EQ(receive_all(ring, 1), std::vector<Bytes>{payload(4, 90)});
      EXPECT_EQ(ring.refused(FrameProblem::kUdpChecksum), 1U);
    });
  }
}

TEST(RingTransport, SpeaksWithThisHostOverTheLoopbackCard) {
  in_namespace([] {
    RingTransport one(TwoHosts::options("lo", "127.0.0.1"));
    RingTransport other(TwoHosts::options("lo", "127.0.0.1"));
    UdpTransport kernels(TwoHosts::options("lo", "127.0.0.1"));
    const std::vector<Bytes> sent = {payload(1, 700), payload(2, 700), payload(3, 30)};
    EXPECT_EQ(one.send(to_all(other.local_address(), sent)).taken, 3U);
    EXPECT_EQ(receive_all(other, 3), sent);
    EXPECT_EQ(kernels.send(to_all(one.local_address(), sent)).taken, 3U);
    EXPECT_EQ(receive_all(one, 3), sent);
  });
}

TEST(RingTransport, SpeaksOverAVlan) {
  in_namespace([] {
    const TwoHosts hosts;
    const bool ready = hosts.made() && shell("ip link add link va name va.7 type vlan id 7") &&
                       shell("ip addr add 10.96.0.1/24 dev va.7") && shell("ip link set va.7 up") &&
                       hosts.shell_there("ip link add link vb name vb.7 type vlan id 7") &&
                       hosts.shell_there("ip addr add 10.96.0.2/24 dev vb.7") &&
                       hosts.shell_there("ip link set vb.7 up") &&
                       // So that nothing but the tag keeps them from whoever listens below.
                       hosts.shell_there("ip addr add 10.96.0.2/32 dev vb");
    if (!ready) GTEST_SKIP() << "needs VLANs";
    RingTransport here(TwoHosts::options("va.7", "10.96.0.1"));
    auto there = hosts.there(
        [] { return std::make_unique<RingTransport>(TwoHosts::options("vb.7", "10.96.0.2")); });
    // The same port on the untagged network below hears nothing of it.
    auto below = hosts.there([&] {
      return std::make_unique<RingTransport>(
          TwoHosts::options("vb", "10.96.0.2", port_of(there->local_address())));
    });
    const std::vector<Bytes> sent = {payload(1, 700), payload(2, 700), payload(3, 30)};
    auto batch = to_all(there->local_address(), sent);
    std::span<const Outgoing> rest = batch;
    const TimePoint end = now() + kPatience;
    while (!rest.empty() && now() < end) rest = rest.subspan(here.send(rest).taken);
    EXPECT_EQ(receive_all(*there, 3), sent);
    while (below->refused(FrameProblem::kVlan) == 0 && now() < end && wait_for(*below, POLLIN)) {
      EXPECT_TRUE(below->receive().empty());
    }
    EXPECT_GT(below->refused(FrameProblem::kVlan), 0U);
    EXPECT_EQ(below->counters().received_datagrams, 0U);
  });
}

TEST(RingTransport, SaysThatRulesOfThisHostDoNotApply) {
  in_namespace([] {
    const RingTransport ring(TwoHosts::options("va", "10.99.0.1"));
    EXPECT_THAT(ring.warnings(), testing::Contains(testing::HasSubstr("bypass nftables and NAT")));
  });
}

TEST(RingTransport, NamesTheRemedyWithoutThePrivilege) {
  in_namespace([] {
    // As an ordinary user would have it.
    __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
    __user_cap_data_struct none[2]{};
    ASSERT_EQ(::syscall(SYS_capset, &header, none), 0);
    try {
      const RingTransport ring(TwoHosts::options("va", "10.99.0.1"));
      ADD_FAILURE() << "no error";
    } catch (const IoError& error) {
      EXPECT_EQ(error.code(), EPERM);
      EXPECT_THAT(error.what(), testing::HasSubstr("setcap cap_net_raw+ep"));
      EXPECT_THAT(error.what(), testing::HasSubstr("--transport udp"));
      EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
    }
  });
}

TEST(RingFilter, IsAsShortAsItSays) {
  for (const bool ethernet : {false, true}) {
    for (const bool ipv6 : {false, true}) {
      const auto code = ring_filter({.ethernet = ethernet, .ipv6 = ipv6, .port = 47000});
      EXPECT_LE(code.size(), 80U);
      EXPECT_EQ(code.back().code, BPF_RET | BPF_K);
      EXPECT_EQ(code.back().k, 0U);
    }
  }
}

}  // namespace
}  // namespace interneuron::io::ring_transport_test
