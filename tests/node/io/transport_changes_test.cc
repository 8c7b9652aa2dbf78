// What every transport of a NIC does alike when something around it changes or is not meant for it,
// each combination of sender and receiver over a link between two network namespaces.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include "node/ring/ring_transport.h"
#include "transport_conformance.h"

namespace interneuron::io::transport_changes_test {
namespace {

class TransportChanges : public TransportConformance {};

TEST_P(TransportChanges, APortIsTakenWhileItIsHeldAndFreeAfterwards) {
  run([](Pair& pair) {
    const auto kind = std::get<0>(GetParam());
    const std::uint16_t port = port_of(pair.to_here);
    for (const Kind other : {Kind::kUdp, Kind::kRing, Kind::kXdp}) {
      try {
        make(other, TwoHosts::options("va", "10.99.0.1", port));
        ADD_FAILURE() << "no error";
      } catch (const IoError& error) {
        EXPECT_EQ(error.code(), EADDRINUSE);
        EXPECT_THAT(error.what(), testing::HasSubstr("is taken"));
      }
    }
    pair.here.reset();
    pair.here = make(kind, TwoHosts::options("va", "10.99.0.1", port));
    EXPECT_EQ(pair.here->local_address(), pair.to_here);
    EXPECT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    EXPECT_TRUE(gets_through(*pair.there, pair.to_here, *pair.here));
  });
}

TEST_P(TransportChanges, ANicThatWasRemovedIsGone) {
  run([](Pair& pair) {
    ASSERT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    ASSERT_TRUE(shell("ip link del va"));
    const auto batch = to_all(pair.to_there, {payload(1, 50), payload(2, 50), payload(3, 60)});
    const BatchResult result = pair.here->send(batch);
    EXPECT_NE(result.gone, 0);
    EXPECT_EQ(result.taken, 3U);
    EXPECT_EQ(pair.here->counters().send_errors, 3U);
    EXPECT_TRUE(pair.here->receive().empty());
    // Also for one that does not send itself.
    EXPECT_NE(pair.there->send(to_all(pair.to_here, {payload(1, 50)})).gone, 0);
  });
}

TEST_P(TransportChanges, ANicThatIsDownIsNotGone) {
  run([](Pair& pair) {
    ASSERT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    ASSERT_TRUE(shell("ip link set va down"));
    const BatchResult result = pair.here->send(to_all(pair.to_there, {payload(1, 50)}));
    EXPECT_EQ(result.gone, 0);
    EXPECT_TRUE(pair.here->receive().empty());
    ASSERT_TRUE(shell("ip link set va up"));
    EXPECT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    EXPECT_TRUE(gets_through(*pair.there, pair.to_here, *pair.here));
  });
}

TEST_P(TransportChanges, ANeighbourThatAnswersLaterIsReachedThen) {
  run([](Pair& pair) {
    ASSERT_TRUE(pair.hosts.shell_there("ip link set vb arp off"));
    const BatchResult first = pair.here->send(to_all(pair.to_there, {payload(1, 50)}));
    EXPECT_EQ(first.gone, 0);
    if (std::get<0>(GetParam()) == Kind::kRing) {
      // Nothing is queued where nobody sees it.
      EXPECT_TRUE(first.refused);
      EXPECT_EQ(first.taken, 0U);
      EXPECT_EQ(pair.here->counters().sent_datagrams, 0U);
      EXPECT_EQ(pair.here->counters().send_refusals, 1U);
    }
    ASSERT_TRUE(pair.hosts.shell_there("ip link set vb arp on"));
    EXPECT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
  });
}

// Strangers may forge requests in the names of hosts that are not there.
TEST_P(TransportChanges, APeerThatIsAskedForHoldsUpNobodyElse) {
  run([](Pair& pair) {
    ASSERT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    const Address nobody = *make_address("10.99.0.77", port_of(pair.to_there));
    const std::vector<Bytes> payloads{payload(1, 50), payload(2, 60), payload(3, 70)};
    std::vector<Outgoing> batch = to_all(pair.to_there, payloads);
    batch[0].to = batch[1].to = nobody;
    const BatchResult sent = pair.here->send(batch);
    EXPECT_EQ(sent.taken, batch.size());
    EXPECT_FALSE(sent.refused);
    EXPECT_EQ(receive_all(*pair.there, 1), std::vector<Bytes>{payloads[2]});
  });
}

TEST_P(TransportChanges, AHardwareAddressThatChangesIsFollowed) {
  run([](Pair& pair) {
    ASSERT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    ASSERT_TRUE(gets_through(*pair.there, pair.to_here, *pair.here));
    // The other end's, as the kernel here learns it, and our own.
    ASSERT_TRUE(pair.hosts.shell_there("ip link set vb address 02:00:00:00:00:99"));
    ASSERT_TRUE(shell("ip neigh replace 10.99.0.2 lladdr 02:00:00:00:00:99 dev va"));
    EXPECT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
    ASSERT_TRUE(shell("ip link set va address 02:00:00:00:00:77"));
    ASSERT_TRUE(
        pair.hosts.shell_there("ip neigh replace 10.99.0.1 lladdr 02:00:00:00:00:77 dev vb"));
    EXPECT_TRUE(gets_through(*pair.there, pair.to_here, *pair.here));
    EXPECT_TRUE(gets_through(*pair.here, pair.to_there, *pair.there));
  });
}

TEST_P(TransportChanges, NobodyIsToldThatThePortIsClosed) {
  run([](Pair& pair) {
    // A connected socket is told of "port unreachable".
    const FileDescriptor client(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::connect(client.get(), reinterpret_cast<const sockaddr*>(pair.to_there.raw.data()),
                        pair.to_there.size),
              0);
    for (int i = 0; i < 3; ++i) {
      ASSERT_EQ(::send(client.get(), "abc", 3, 0), 3) << std::strerror(errno);
      ASSERT_EQ(receive_all(*pair.there, 1).size(), 1U);
    }
    // An answer of the kernel would have come before this.
    sockaddr_in local{};
    socklen_t size = sizeof local;
    ASSERT_EQ(::getsockname(client.get(), reinterpret_cast<sockaddr*>(&local), &size), 0);
    const Address back = from_sockaddr(reinterpret_cast<const sockaddr*>(&local), size);
    ASSERT_TRUE(send_all(*pair.there, back, {payload(1, 50)}));
    std::array<char, 100> bytes{};
    EXPECT_EQ(::recv(client.get(), bytes.data(), bytes.size(), 0), 50) << std::strerror(errno);
  });
}

TEST_P(TransportChanges, WhatIsDamagedOrNotForUsIsDropped) {
  run([](Pair& pair) {
    FrameAddresses addresses;
    addresses.ethernet =
        EthernetHeader{.to = parse_mac(pair.hosts.there([] { return find_nic("vb")->mac; })),
                       .from = parse_mac(find_nic("va")->mac)};
    addresses.from = pair.to_here;
    addresses.to = pair.to_there;
    const FrameSender sender("va");
    const Bytes good = whole_frame(addresses, payload(1, 50));
    // A wrong UDP checksum; a wrong one of IP; the first part of a packet; a later part.
    Bytes bad = good;
    bad.back() ^= std::byte{1};
    ASSERT_TRUE(sender.send(bad));
    bad = good;
    bad[22] ^= std::byte{1};
    ASSERT_TRUE(sender.send(bad));
    for (const auto& [word, sum] : {std::pair{0x20, 0x20}, std::pair{0x00, 0x40}}) {
      // "More fragments" instead of "don't fragment", and the checksum that goes with it.
      bad = good;
      bad[20] = static_cast<std::byte>(word);
      const unsigned old = std::to_integer<unsigned>(bad[24]);
      bad[24] = static_cast<std::byte>(old + static_cast<unsigned>(sum));
      if (word == 0) bad[21] = std::byte{1};
      ASSERT_TRUE(sender.send(bad));
    }
    // Another address, another VLAN.
    FrameAddresses other = addresses;
    other.to = *make_address("10.99.0.77", port_of(pair.to_there));
    ASSERT_TRUE(sender.send(whole_frame(other, payload(1, 50))));
    other = addresses;
    other.ethernet->tag = 5;
    ASSERT_TRUE(sender.send(whole_frame(other, payload(1, 50))));
    // A tag without a VLAN, and none.
    other.ethernet->tag = 0xe000;
    ASSERT_TRUE(sender.send(whole_frame(other, payload(2, 50))));
    ASSERT_TRUE(sender.send(whole_frame(addresses, payload(3, 50))));
    EXPECT_EQ(receive_all(*pair.there, 2), (std::vector<Bytes>{payload(2, 50), payload(3, 50)}));
    if (const auto* ring = dynamic_cast<const RingTransport*>(pair.there.get())) {
      EXPECT_EQ(ring->refused(FrameProblem::kUdpChecksum), 1U);
      EXPECT_EQ(ring->refused(FrameProblem::kFragment), 1U);
      EXPECT_EQ(ring->refused(FrameProblem::kIpChecksum) + ring->refused(FrameProblem::kFragment) +
                    ring->refused(FrameProblem::kUdpChecksum) + ring->refused(FrameProblem::kVlan),
                ring->counters().receive_errors);
      EXPECT_EQ(ring->refused(FrameProblem::kVlan), 1U);
    }
  });
}

TEST_P(TransportChanges, ANeighbourOfIpv6IsFound) {
  run_alone([] {
    TwoHosts hosts;
    if (!hosts.made()) GTEST_SKIP();
    const auto [kind_here, kind_there] = GetParam();
    const auto here = make(kind_here, TwoHosts::options("va", "fd99::1"));
    const auto there =
        hosts.there([kind = kind_there] { return make(kind, TwoHosts::options("vb", "fd99::2")); });
    EXPECT_TRUE(gets_through(*here, there->local_address(), *there));
    EXPECT_TRUE(gets_through(*there, here->local_address(), *here));
  });
}

TEST_P(TransportChanges, LinksAreApart) {
  run([](Pair& pair) {
    ASSERT_TRUE(pair.hosts.add_second_link());
    const auto [kind_here, kind_there] = GetParam();
    // The same ports as on the first link.
    const auto here = make(kind_here, TwoHosts::options("vc", "10.98.0.1", port_of(pair.to_here)));
    const auto there = pair.hosts.there([&, kind = kind_there] {
      return make(kind, TwoHosts::options("vd", "10.98.0.2", port_of(pair.to_there)));
    });
    const std::vector<Bytes> first = {payload(1, 50), payload(2, 1200)};
    const std::vector<Bytes> second = {payload(3, 60), payload(4, 1300), payload(5, 1300)};
    ASSERT_TRUE(send_all(*pair.here, pair.to_there, first));
    ASSERT_TRUE(send_all(*here, there->local_address(), second));
    EXPECT_EQ(receive_all(*pair.there, 2), first);
    EXPECT_EQ(receive_all(*there, 3), second);
    EXPECT_FALSE(readable(*pair.there, 5) && !pair.there->receive().empty());
    EXPECT_EQ(pair.there->counters().received_datagrams, 2U);
    EXPECT_EQ(there->counters().received_datagrams, 3U);
  });
}

TEST_P(TransportChanges, APeerThatMovesIsSeenWhereItIs) {
  run([](Pair& pair) {
    ASSERT_TRUE(gets_through(*pair.there, pair.to_here, *pair.here));
    // A new address and a new port, as after a new lease.
    ASSERT_TRUE(shell("ip addr add 10.99.0.9/24 dev va"));
    pair.here.reset();
    pair.here = make(std::get<0>(GetParam()), TwoHosts::options("va", "10.99.0.9"));
    const Address moved = pair.here->local_address();
    ASSERT_TRUE(send_all(*pair.here, pair.to_there, {payload(1, 50)}));
    const Address from = senders(*pair.there, 1).front();
    EXPECT_EQ(to_string(from), to_string(moved));
    EXPECT_TRUE(gets_through(*pair.there, from, *pair.here));
  });
}

TEST_P(TransportChanges, OtherPortsAreNotHeard) {
  run([](Pair& pair) {
    const Address other = with_port(pair.to_there, port_of(pair.to_there) == 9 ? 10 : 9);
    ASSERT_TRUE(send_all(*pair.here, other, {payload(1, 50), payload(2, 50)}));
    ASSERT_TRUE(send_all(*pair.here, pair.to_there, {payload(3, 50)}));
    EXPECT_EQ(receive_all(*pair.there, 1), std::vector<Bytes>{payload(3, 50)});
    EXPECT_EQ(pair.there->counters().received_datagrams, 1U);
    EXPECT_EQ(pair.there->counters().receive_errors, 0U);
  });
}

TEST_P(TransportChanges, NothingStaysOpen) {
  run([](Pair& pair) {
    pair.here.reset();
    const std::size_t before = open_descriptors();
    for (int i = 0; i < 3; ++i) {
      const auto kind = std::get<0>(GetParam());
      auto other = make(kind, TwoHosts::options("va", "10.99.0.1", port_of(pair.to_here)));
      EXPECT_TRUE(gets_through(*other, pair.to_there, *pair.there));
      // What fails early and what fails late: the port is taken, which is seen when there is a
      // socket; another program is on the card, which is seen when there is one to be put on it.
      const std::size_t with_other = open_descriptors();
      EXPECT_THROW(make(kind, TwoHosts::options("nosuch", "10.99.0.1")), IoError);
      EXPECT_THROW(make(kind, TwoHosts::options("va", "10.99.0.1", port_of(pair.to_here))),
                   IoError);
      if (kind == Kind::kXdp) {
        EXPECT_THROW(make(kind, TwoHosts::options("va", "10.99.0.1")), IoError);
      }
      EXPECT_EQ(open_descriptors(), with_other);
      other.reset();
      EXPECT_EQ(open_descriptors(), before);
    }
  });
}

TEST_P(TransportChanges, AnAddressOfTheOtherFamilyIsDroppedAndCounted) {
  run([](Pair& pair) {
    const auto batch = to_all(*parse_address("[fd99::2]:9"), {payload(1, 50), payload(2, 50)});
    EXPECT_EQ(pair.here->send(batch).taken, 2U);
    EXPECT_EQ(pair.here->send(to_all(Address{}, {payload(1, 50)})).taken, 1U);
    EXPECT_EQ(pair.here->counters().send_errors, 3U);
    EXPECT_EQ(pair.here->counters().sent_datagrams, 0U);
  });
}

INSTANTIATE_TEST_SUITE_P(All, TransportChanges, all_kinds(),
                         [](const auto& test) { return name_of(test.param); });

}  // namespace
}  // namespace interneuron::io::transport_changes_test
