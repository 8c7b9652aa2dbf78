// What every transport of a NIC does alike, each combination of sender and receiver over a link
// between two network namespaces.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/if_tun.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "host/io/ring_transport.h"
#include "host/io/steady_clock.h"
#include "host/io/udp_transport.h"
#include "support.h"
#include "two_hosts.h"

namespace interneuron::io {
namespace {

enum class Kind { kUdp, kRing };

std::unique_ptr<Transport> make(Kind kind, const UdpOptions& options) {
  if (kind == Kind::kUdp) return std::make_unique<UdpTransport>(options);
  return std::make_unique<RingTransport>(options);
}

// The kinds of the transports here and there.
using Kinds = std::tuple<Kind, Kind>;

// Two hosts, each with a transport.
struct Pair {
  TwoHosts hosts;
  std::unique_ptr<Transport> here;
  std::unique_ptr<Transport> there;
  Address to_there;
  Address to_here;

  // False when this machine cannot do it.
  bool open(const Kinds& kinds, bool ipv6 = false) {
    if (!hosts.made()) return false;
    const auto [kind_here, kind_there] = kinds;
    here = make(kind_here, TwoHosts::options("va", ipv6 ? "fd99::1" : "10.99.0.1"));
    there = hosts.there([&, kind = kind_there] {
      return make(kind, TwoHosts::options("vb", ipv6 ? "fd99::2" : "10.99.0.2"));
    });
    to_there = there->local_address();
    to_here = here->local_address();
    return know_each_other(ipv6);
  }

 private:
  // Lets both kernels learn the other's hardware address, which takes a second on a card that is
  // just up: a transport that writes frames itself drops what it cannot address by then.
  bool know_each_other(bool ipv6) const;
};

// Offers again what is refused, as an Outbox does, until all is taken.
bool send_all(Transport& transport, std::span<const Outgoing> batch) {
  const TimePoint end = now() + kPatience;
  while (!batch.empty() && now() < end) {
    const BatchResult result = transport.send(batch);
    if (result.gone != 0) return false;
    batch = batch.subspan(result.taken);
    if (result.would_block) wait_for(transport, POLLOUT);
  }
  return batch.empty();
}

bool send_all(Transport& transport, const Address& to, const std::vector<Bytes>& payloads) {
  return send_all(transport, to_all(to, payloads));
}

// Whether something can be received within so many milliseconds.
bool readable(const Transport& transport, int milliseconds) {
  pollfd item{.fd = transport.native_handle(), .events = POLLIN, .revents = 0};
  return ::poll(&item, 1, milliseconds) == 1;
}

// Sends a datagram again and again until one arrives; false when none does.
bool gets_through(Transport& sender, const Address& to, Transport& receiver) {
  const TimePoint end = now() + kPatience;
  const Bytes bytes = payload(99, 100);
  while (now() < end) {
    sender.send(to_all(to, {bytes}));
    if (readable(receiver, 10) && !receiver.receive().empty()) return true;
  }
  return false;
}

bool Pair::know_each_other(bool ipv6) const {
  UdpTransport a(TwoHosts::options("va", ipv6 ? "fd99::1" : "10.99.0.1"));
  const auto b = hosts.there([&] {
    return std::make_unique<UdpTransport>(TwoHosts::options("vb", ipv6 ? "fd99::2" : "10.99.0.2"));
  });
  return gets_through(a, b->local_address(), *b) && gets_through(*b, a.local_address(), a);
}

// The first datagrams that come; a transport may be readable before there is one.
std::span<const Incoming> first_of(Transport& transport) {
  const TimePoint end = now() + kPatience;
  while (now() < end && wait_for(transport, POLLIN)) {
    if (const auto got = transport.receive(); !got.empty()) return got;
  }
  return {};
}

class TransportConformance : public testing::TestWithParam<Kinds> {
 protected:
  // Runs a test in a namespace, with both transports.
  static void run(const std::function<void(Pair&)>& body, bool ipv6 = false) {
    in_namespace([&] {
      Pair pair;
      if (!pair.open(GetParam(), ipv6)) GTEST_SKIP();
      body(pair);
    });
  }
};

TEST_P(TransportConformance, EverySizeArrives) {
  for (const bool ipv6 : {false, true}) {
    run(
        [&](Pair& pair) {
          // What fits into an MTU of 1500.
          const std::size_t most = ipv6 ? 1452 : 1472;
          std::vector<Bytes> payloads;
          for (std::size_t size = 1; size <= most; size += size < 40 || size > most - 8 ? 1 : 7) {
            payloads.push_back(payload(size, size));
          }
          payloads.push_back(payload(0, most));
          ASSERT_TRUE(send_all(*pair.here, pair.to_there, payloads));
          EXPECT_EQ(receive_all(*pair.there, payloads.size()), payloads);
          EXPECT_EQ(pair.here->counters().send_errors, 0U);
          EXPECT_EQ(pair.there->counters().receive_errors, 0U);
          // One byte more is dropped and counted, alone among others.
          const std::vector<Bytes> large = {payload(1, 9), payload(2, most + 1), payload(3, 9)};
          ASSERT_TRUE(send_all(*pair.here, pair.to_there, large));
          EXPECT_EQ(receive_all(*pair.there, 2), (std::vector<Bytes>{large[0], large[2]}));
          EXPECT_EQ(pair.here->counters().send_errors, 1U);
          EXPECT_EQ(pair.here->counters().last_send_error, EMSGSIZE);
        },
        ipv6);
  }
}

TEST_P(TransportConformance, BatchesArriveOnceAndInOrder) {
  for (const bool ipv6 : {false, true}) {
    run(
        [&](Pair& pair) {
          std::vector<Bytes> sent;
          std::vector<Bytes> got;
          for (std::size_t turn = 0; turn < 20; ++turn) {
            std::vector<Bytes> batch;
            for (std::size_t i = 0; i < 200; ++i) {
              // Runs of equal ones with a shorter last, and mixed ones.
              batch.push_back(payload(
                  turn * 200 + i, turn % 2 == 0 ? (i % 40 == 39 ? 77 : 1200) : 100 + i * 13 % 900));
            }
            ASSERT_TRUE(send_all(*pair.here, pair.to_there, batch));
            for (Bytes& bytes : receive_all(*pair.there, batch.size())) got.push_back(bytes);
            sent.insert(sent.end(), batch.begin(), batch.end());
          }
          EXPECT_TRUE(got == sent) << got.size() << " of " << sent.size();
          EXPECT_EQ(pair.here->counters().sent_datagrams, sent.size());
          EXPECT_EQ(pair.there->counters().received_datagrams, sent.size());
          EXPECT_EQ(pair.here->counters().offload_refused, 0U);
          // Runs leave in one call, which the kernel or the NIC segments.
          EXPECT_LT(pair.here->counters().send_calls, sent.size() / 4);
        },
        ipv6);
  }
}

TEST_P(TransportConformance, PartsArriveAsOneDatagram) {
  run([](Pair& pair) {
    std::vector<Bytes> whole;
    std::vector<Outgoing> batch;
    for (std::size_t i = 0; i < 300; ++i) whole.push_back(payload(i, i % 50 == 49 ? 61 : 301));
    for (std::size_t i = 0; i < whole.size(); ++i) {
      const ByteView bytes(whole[i]);
      const std::size_t head = i % 3 == 0 ? 1 : 37;
      const std::size_t tail = i % 5 == 0 ? 0 : 15;
      batch.push_back({.to = pair.to_there,
                       .head = bytes.first(head),
                       .payload = bytes.subspan(head, bytes.size() - head - tail),
                       .tail = bytes.last(tail)});
    }
    ASSERT_TRUE(send_all(*pair.here, batch));
    EXPECT_EQ(receive_all(*pair.there, whole.size()), whole);
  });
}

TEST_P(TransportConformance, FromIsWhereAnAnswerGoes) {
  for (const bool ipv6 : {false, true}) {
    run(
        [](Pair& pair) {
          ASSERT_TRUE(send_all(*pair.here, pair.to_there, {payload(1, 50)}));
          const auto got = first_of(*pair.there);
          ASSERT_EQ(got.size(), 1U);
          EXPECT_EQ(to_string(got[0].from), to_string(pair.to_here));
          EXPECT_EQ(got[0].from, pair.to_here);
          ASSERT_TRUE(send_all(*pair.there, got[0].from, {payload(2, 60)}));
          EXPECT_EQ(receive_all(*pair.here, 1), std::vector<Bytes>{payload(2, 60)});
        },
        ipv6);
  }
}

TEST_P(TransportConformance, AnswersLeaveFromTheAddressThatWasAsked) {
  in_namespace([] {
    Pair pair;
    if (!pair.open(GetParam())) GTEST_SKIP();
    pair.there = pair.hosts.there([] {
      UdpOptions any = TwoHosts::options("vb", "0.0.0.0");
      any.answer_from_receiver = true;
      return make(std::get<1>(GetParam()), any);
    });
    const std::uint16_t port = port_of(pair.there->local_address());
    // The one without a route of its own is a neighbour too, since the sender is on the NIC.
    for (const char* host : {"10.99.0.3", "10.99.0.2", "10.99.0.3"}) {
      const Address asked = *make_address(host, port);
      ASSERT_TRUE(send_all(*pair.here, asked, {payload(1, 50), payload(2, 50)}));
      const auto question = first_of(*pair.there);
      ASSERT_FALSE(question.empty());
      const Address from = question[0].from;
      EXPECT_EQ(to_string(from), to_string(pair.to_here));
      ASSERT_TRUE(send_all(*pair.there, from, {payload(3, 50)}));
      const auto answer = first_of(*pair.here);
      ASSERT_FALSE(answer.empty());
      EXPECT_EQ(to_string(answer[0].from), to_string(asked));
      // Nothing of this turn is left for the next.
      while (readable(*pair.there, 0) && !pair.there->receive().empty()) continue;
    }
  });
}

TEST_P(TransportConformance, EcnBitsTravelWithTheirDatagrams) {
  for (const bool ipv6 : {false, true}) {
    run(
        [](Pair& pair) {
          std::vector<Bytes> payloads;
          std::vector<Outgoing> batch;
          for (std::size_t i = 0; i < 40; ++i) payloads.push_back(payload(i, 200));
          const auto there_and_back = [&](Transport& from, Transport& to, const Address& address) {
            batch.clear();
            for (std::size_t i = 0; i < payloads.size(); ++i) {
              batch.push_back(
                  {.to = address, .head = payloads[i], .ecn = static_cast<std::uint8_t>(i / 10)});
            }
            ASSERT_TRUE(send_all(from, batch));
            std::size_t count = 0;
            while (count < batch.size() && wait_for(to, POLLIN)) {
              for (const Incoming& datagram : to.receive()) {
                EXPECT_EQ(datagram.ecn, batch[count++].ecn) << count;
              }
            }
          };
          there_and_back(*pair.here, *pair.there, pair.to_there);
          there_and_back(*pair.there, *pair.here, pair.to_here);
        },
        ipv6);
  }
}

TEST_P(TransportConformance, TellsWhenTheKernelReceived) {
  run([](Pair& pair) {
    const Duration slack = std::chrono::milliseconds(1);
    const TimePoint before = now() - slack;
    ASSERT_TRUE(send_all(*pair.here, pair.to_there, {payload(0, 100)}));
    const TimePoint sent = now() + slack;
    const auto batch = first_of(*pair.there);
    ASSERT_EQ(batch.size(), 1U);
    EXPECT_GE(batch[0].at, before);
    EXPECT_LE(batch[0].at, sent);
  });
}

TEST_P(TransportConformance, APortIsTakenWhileItIsHeldAndFreeAfterwards) {
  run([](Pair& pair) {
    const auto kind = std::get<0>(GetParam());
    const std::uint16_t port = port_of(pair.to_here);
    for (const Kind other : {Kind::kUdp, Kind::kRing}) {
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

TEST_P(TransportConformance, ANicThatWasRemovedIsGone) {
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

TEST_P(TransportConformance, ANicThatIsDownIsNotGone) {
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

TEST_P(TransportConformance, ANeighbourThatAnswersLaterIsReachedThen) {
  run([](Pair& pair) {
    ASSERT_TRUE(pair.hosts.shell_there("ip link set vb arp off"));
    ASSERT_TRUE(shell("ip neigh flush dev va"));
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

TEST_P(TransportConformance, AHardwareAddressThatChangesIsFollowed) {
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

TEST_P(TransportConformance, NobodyIsToldThatThePortIsClosed) {
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

TEST_P(TransportConformance, WhatIsDamagedOrNotForUsIsDropped) {
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

TEST_P(TransportConformance, AnAddressOfTheOtherFamilyIsDroppedAndCounted) {
  run([](Pair& pair) {
    const auto batch = to_all(*parse_address("[fd99::2]:9"), {payload(1, 50), payload(2, 50)});
    EXPECT_EQ(pair.here->send(batch).taken, 2U);
    EXPECT_EQ(pair.here->send(to_all(Address{}, {payload(1, 50)})).taken, 1U);
    EXPECT_EQ(pair.here->counters().send_errors, 3U);
    EXPECT_EQ(pair.here->counters().sent_datagrams, 0U);
  });
}

// A modem in raw IP mode has frames without Ethernet headers, as a tun device has.
TEST(RingTransport, NeedsNoEthernetHeaders) {
  in_namespace([] {
    const FileDescriptor modem(::open("/dev/net/tun", O_RDWR | O_CLOEXEC));
    ifreq request{};
    std::strncpy(request.ifr_name, "wwan7", IFNAMSIZ - 1);
    request.ifr_flags = IFF_TUN | IFF_NO_PI;
    if (modem.get() < 0 || ::ioctl(modem.get(), TUNSETIFF, &request) != 0) {
      GTEST_SKIP() << "no tun device here";
    }
    ASSERT_TRUE(shell("ip addr add 10.98.0.1/24 dev wwan7") && shell("ip link set wwan7 up"));
    RingTransport here(TwoHosts::options("wwan7", "10.98.0.1"));
    const Address peer = *make_address("10.98.0.2", 4700);
    // Three of them leave as one, which the kernel divides for a device that cannot.
    const std::vector<Bytes> payloads{payload(1, 500), payload(2, 500), payload(3, 300)};
    ASSERT_TRUE(send_all(here, peer, payloads));
    std::array<std::byte, 2000> packet{};
    const FrameContext raw{.ethernet = false};
    for (const Bytes& wanted : payloads) {
      // The kernel sends packets of its own, to find routers.
      std::optional<ParsedFrame> datagram;
      while (!datagram) {
        const ssize_t size = ::read(modem.get(), packet.data(), packet.size());
        ASSERT_GT(size, 0);
        const auto parsed = parse_frame({packet.data(), static_cast<std::size_t>(size)}, raw);
        if (std::holds_alternative<ParsedFrame>(parsed)) datagram = std::get<ParsedFrame>(parsed);
      }
      EXPECT_EQ(datagram->to, peer);
      EXPECT_EQ(datagram->from, here.local_address());
      EXPECT_TRUE(std::ranges::equal(datagram->payload, wanted));
    }
    FrameAddresses back;
    back.from = peer;
    back.to = here.local_address();
    const Bytes answer = whole_frame(back, payload(4, 60));
    ASSERT_EQ(::write(modem.get(), answer.data(), answer.size()),
              static_cast<ssize_t>(answer.size()));
    const auto got = first_of(here);
    ASSERT_EQ(got.size(), 1U);
    EXPECT_EQ(got[0].from, peer);
    EXPECT_TRUE(std::ranges::equal(got[0].bytes, payload(4, 60)));
  });
}

INSTANTIATE_TEST_SUITE_P(All, TransportConformance,
                         testing::Combine(testing::Values(Kind::kUdp, Kind::kRing),
                                          testing::Values(Kind::kUdp, Kind::kRing)),
                         [](const auto& test) {
                           const auto name = [](Kind kind) {
                             return kind == Kind::kUdp ? "Udp" : "Ring";
                           };
                           return std::string(name(std::get<0>(test.param))) + "To" +
                                  name(std::get<1>(test.param));
                         });

}  // namespace
}  // namespace interneuron::io
