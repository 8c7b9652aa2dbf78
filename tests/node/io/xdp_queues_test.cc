// Receive queues of cards, of which each has an AF_XDP socket of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>

#include "node/xdp/xdp_transport.h"
#include "tests/run_queue.h"
#include "transport_conformance.h"

namespace interneuron::io::xdp_queues_test {
namespace {

// vc 10.98.0.1/24 with three queues, and vd, which sends to it by as many.
class QueuedCards {
 public:
  static constexpr std::size_t kFlows = 40;

  QueuedCards()
      : made_(shell("ip link add vc numtxqueues 3 numrxqueues 3 type veth peer name vd "
                    "numtxqueues 3 numrxqueues 3") &&
              shell("ip link set vc up") && shell("ip link set vd up") &&
              shell("ip addr add 10.98.0.1/24 dev vc")) {}
  bool made() const { return made_; }
  // A datagram of each of many flows: those of a flow come by one queue, so that these come by all.
  bool send_flows(const Address& to) const {
    FrameAddresses addresses;
    addresses.ethernet = EthernetHeader{.to = parse_mac(find_nic("vc")->mac),
                                        .from = parse_mac(find_nic("vd")->mac)};
    addresses.to = to;
    const FrameSender sender("vd");
    for (std::size_t flow = 0; flow < kFlows; ++flow) {
      addresses.from = *make_address("10.98.0.2", static_cast<std::uint16_t>(1000 + flow));
      if (!sender.send(whole_frame(addresses, payload(flow, 60)))) return false;
    }
    return true;
  }

 private:
  bool made_;
};

TEST(XdpQueues, AllOfACardAreHeard) {
  as_root([] {
    const QueuedCards cards;
    ASSERT_TRUE(cards.made());
    XdpTransport xdp(TwoHosts::options("vc", "10.98.0.1"));
    ASSERT_TRUE(cards.send_flows(xdp.local_address()));
    EXPECT_EQ(receive_all(xdp, QueuedCards::kFlows).size(), QueuedCards::kFlows);
    EXPECT_EQ(xdp.counters().receive_errors, 0U);
  });
}

// Changes how many queues of a card are in use, as `ethtool -L` does.
bool use_queues(const char* nic, std::uint32_t receive, std::uint32_t send) {
  const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ethtool_channels channels{};
  channels.cmd = ETHTOOL_GCHANNELS;
  ifreq request{};
  std::strncpy(request.ifr_name, nic, IFNAMSIZ - 1);
  request.ifr_data = reinterpret_cast<char*>(&channels);
  if (::ioctl(socket.get(), SIOCETHTOOL, &request) != 0) return false;
  channels.cmd = ETHTOOL_SCHANNELS;
  channels.rx_count = receive;
  channels.tx_count = send;
  return ::ioctl(socket.get(), SIOCETHTOOL, &request) == 0;
}

TEST(XdpQueues, ThoseThatComeIntoUseLaterAreHeard) {
  as_root([] {
    const QueuedCards cards;
    ASSERT_TRUE(cards.made());
    if (!use_queues("vd", 3, 1) || !use_queues("vc", 1, 3)) {
      GTEST_SKIP() << "this kernel cannot change the queues of veth";
    }
    XdpTransport xdp(TwoHosts::options("vc", "10.98.0.1"));
    ASSERT_TRUE(cards.send_flows(xdp.local_address()));
    EXPECT_EQ(receive_all(xdp, QueuedCards::kFlows).size(), QueuedCards::kFlows);
    EXPECT_EQ(xdp.counters().receive_errors, 0U);
    // A veth card runs the program for further queues only from when it is up again.
    ASSERT_TRUE(use_queues("vc", 3, 3) && use_queues("vd", 3, 3) && shell("ip link set vc down") &&
                shell("ip link set vc up"));
    // Until it looks, frames of the new ones are dropped, but counted: each is one or the other.
    std::size_t sent = QueuedCards::kFlows;
    bool all = false;
    const TimePoint end = now() + kPatience;
    while (!all && now() < end) {
      const std::uint64_t before = xdp.counters().received_datagrams;
      ASSERT_TRUE(cards.send_flows(xdp.local_address()));
      sent += QueuedCards::kFlows;
      const auto known = [&xdp] {
        return xdp.counters().received_datagrams + xdp.counters().receive_errors;
      };
      while (known() < sent && now() < end) {
        readable(xdp, 1);
        xdp.receive();
      }
      all = xdp.counters().received_datagrams - before == QueuedCards::kFlows;
    }
    EXPECT_TRUE(all);
    EXPECT_GT(xdp.counters().receive_errors, 0U);
    EXPECT_EQ(xdp.counters().received_datagrams + xdp.counters().receive_errors, sent);
  });
}

TEST(XdpQueues, WhereTheDriverDoesNotTellAllThatThereAreAreTaken) {
  as_root([] {
    if (!shell("ip link add br0 numrxqueues 3 type bridge") || !shell("ip link set br0 up") ||
        !shell("ip addr add 10.98.0.1/24 dev br0")) {
      GTEST_SKIP() << "this kernel has no bridges";
    }
    EXPECT_EQ(find_nic("br0").value().receive_queues, 3U);
    const XdpTransport xdp(TwoHosts::options("br0", "10.98.0.1"));
    for (const std::uint32_t queue : {0U, 1U, 2U}) {
      try {
        const XdpSocket other("br0", queue, false);
        ADD_FAILURE() << queue << " is free";
      } catch (const IoError& error) {
        EXPECT_EQ(error.code(), EBUSY) << error.what();
      }
    }
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
    // The kernel frees the first queue only some time after an attempt has closed it, which one
    // that may not wait would take for another program's; so that one is the first.
    options.may_wait = false;
    const RunQueue queue;
    const Duration quick = time_of_refusal();
    options.may_wait = true;
    const Duration patient = time_of_refusal();
    if (quick >= patient && queue.busy()) GTEST_SKIP() << "the machine is too busy to tell";
    EXPECT_LT(quick, patient);
    // Nothing stays open, neither descriptors nor the first queue nor the program on the card.
    EXPECT_EQ(open_descriptors(), before);
    other.reset();
    EXPECT_NO_THROW(XdpTransport{options});
  });
}

}  // namespace
}  // namespace interneuron::io::xdp_queues_test
