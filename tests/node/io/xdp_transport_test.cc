// What only AF_XDP has to do: what is left to the kernel, what the kernel does not take, and
// errors. Cards with several receive queues are in xdp_queues_test.cc.
#include "node/xdp/xdp_transport.h"

#include <dirent.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>

#include <fstream>

#include "node/io/udp_socket.h"
#include "transport_conformance.h"

namespace interneuron::io::xdp_transport_test {
namespace {

// Gives up all capabilities but these, by their numbers in linux/capability.h.
void keep_only(std::initializer_list<unsigned> capabilities) {
  constexpr unsigned kBits = 32;
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  __user_cap_data_struct kept[_LINUX_CAPABILITY_U32S_3]{};
  for (const unsigned capability : capabilities) {
    kept[capability / kBits].effective |= 1U << capability % kBits;
    kept[capability / kBits].permitted |= 1U << capability % kBits;
  }
  ASSERT_EQ(::syscall(SYS_capset, &header, kept), 0) << std::strerror(errno);
}

// A header of IPv4 with `words` words of options that say nothing (RFC 791 §3.1, "No Operation").
Bytes with_options(const Bytes& frame, std::size_t words) {
  constexpr std::size_t kIpAt = 14;
  constexpr std::size_t kHeaderBytes = 20;
  constexpr std::size_t kLengthAt = kIpAt + 2;
  constexpr std::size_t kSumAt = kIpAt + 10;
  Bytes out = frame;
  out.insert(out.begin() + kIpAt + kHeaderBytes, 4 * words, std::byte{1});
  out[kIpAt] = static_cast<std::byte>(0x45 + words);
  const auto put = [&out](std::size_t at, std::size_t value) {
    out[at] = static_cast<std::byte>(value >> 8U);
    out[at + 1] = static_cast<std::byte>(value & 0xffU);
  };
  put(kLengthAt, out.size() - kIpAt);
  put(kSumAt, 0);
  std::size_t sum = 0;
  for (std::size_t at = kIpAt; at < kIpAt + kHeaderBytes + 4 * words; at += 2) {
    sum += std::to_integer<std::size_t>(out[at]) << 8U | std::to_integer<std::size_t>(out[at + 1]);
  }
  while (sum >> 16U != 0) sum = (sum & 0xffffU) + (sum >> 16U);
  put(kSumAt, ~sum & 0xffffU);
  return out;
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

// The number of the kernel's thread that polls this card in this network namespace
// (napi/threaded.rst of the Linux documentation); 0: it has none.
pid_t poller_of(const std::string& nic) {
  const std::string name = "napi/" + nic + "-";
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir("/proc"), &::closedir);
  pid_t newest = 0;
  while (const dirent* entry = ::readdir(folder.get())) {
    std::ifstream file("/proc/" + std::string(entry->d_name) + "/comm");
    std::string comm;
    if (std::getline(file, comm) && comm.starts_with(name)) {
      newest = std::max(newest, static_cast<pid_t>(std::stoi(entry->d_name)));
    }
  }
  return newest;
}

// Lets nothing that this thread does be interrupted by the other one, which gets its turn when this
// one sleeps. False where the kernel does not allow it.
bool keep_waiting(pid_t other) {
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(::sched_getcpu(), &one);
  const sched_param first{.sched_priority = 1};
  return ::sched_setaffinity(0, sizeof one, &one) == 0 &&
         ::sched_setaffinity(other, sizeof one, &one) == 0 &&
         ::sched_setscheduler(0, SCHED_FIFO, &first) == 0;
}

// A veth card has room for 256 packets that the other end has not looked at; with a queueing
// discipline it says that it is full (Linux 6.16) instead of dropping what comes then.
class FullCard {
 public:
  static constexpr std::size_t kDatagrams = 900;

  // False where this kernel cannot do it.
  bool fill() {
    if (!hosts_.made() || !shell("tc qdisc add dev va root pfifo")) return false;
    there_ = hosts_.there(
        [] { return std::make_unique<XdpTransport>(TwoHosts::options("vb", "10.99.0.2")); });
    here_ = std::make_unique<XdpTransport>(TwoHosts::options("va", "10.99.0.1"));
    EXPECT_TRUE(gets_through(*here_, there_->local_address(), *there_));
    // A mount of its own, since /sys shows the cards of the namespace that it was mounted in.
    if (!hosts_.shell_there("unshare -m sh -c 'mount -t sysfs x /sys && "
                            "echo 1 > /sys/class/net/vb/threaded'")) {
      return false;
    }
    const pid_t poller = poller_of("vb");
    if (poller == 0 || !keep_waiting(poller)) return false;
    for (std::size_t i = 0; i < kDatagrams; ++i) sent_.push_back(payload(i, 1200));
    const BatchResult result = here_->send(to_all(there_->local_address(), sent_));
    EXPECT_EQ(result.taken, kDatagrams);
    EXPECT_EQ(here_->counters().send_errors, 0U);
    return here_->counters().send_refusals > 0;
  }
  // All that arrives while `again` is called.
  std::vector<Bytes> receive(const std::function<void()>& again) {
    std::vector<Bytes> got;
    const TimePoint end = now() + kPatience;
    while (got.size() < kDatagrams && now() < end) {
      again();
      if (!readable(*there_, 1)) continue;
      for (const Incoming& datagram : there_->receive()) {
        got.emplace_back(datagram.bytes.begin(), datagram.bytes.end());
      }
    }
    return got;
  }
  XdpTransport& here() { return *here_; }
  const std::vector<Bytes>& sent() const { return sent_; }

 private:
  TwoHosts hosts_;
  std::unique_ptr<XdpTransport> there_;
  std::unique_ptr<XdpTransport> here_;
  std::vector<Bytes> sent_;
};

TEST(XdpTransport, WhatTheKernelDidNotTakeLeavesWhenSomethingIsReceived) {
  as_root([] {
    FullCard card;
    if (!card.fill()) GTEST_SKIP() << "this kernel lacks what the test needs";
    const auto got = card.receive([&card] { EXPECT_TRUE(card.here().receive().empty()); });
    EXPECT_TRUE(got == card.sent()) << got.size();
  });
}

TEST(XdpTransport, WhatTheKernelDidNotTakeLeavesWhenNothingElseIsSent) {
  as_root([] {
    FullCard card;
    if (!card.fill()) GTEST_SKIP() << "this kernel lacks what the test needs";
    bool holds = true;
    const auto got = card.receive([&] {
      if (holds) holds = card.here().send({}).refused;
    });
    EXPECT_TRUE(got == card.sent()) << got.size();
    EXPECT_FALSE(holds) << "nobody need come back any more";
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

TEST(XdpTransport, NeedsNoMoreThanTheCapabilitiesThatItAsksFor) {
  for (const bool ipv6 : {false, true}) {
    as_root([ipv6] {
      TwoHosts hosts;
      ASSERT_TRUE(hosts.made() && (!ipv6 || hosts.meet()));
      const auto there = hosts.there([ipv6] {
        return std::make_unique<UdpTransport>(
            TwoHosts::options("vb", ipv6 ? "fd99::2" : "10.99.0.2"));
      });
      // Those of docs/transports.md, and of the line that is printed where they are missing.
      keep_only({CAP_NET_RAW, CAP_NET_ADMIN, CAP_BPF, CAP_IPC_LOCK});
      EXPECT_NO_THROW(require_privilege(TransportKind::kXdp));
      XdpTransport xdp(TwoHosts::options("va", ipv6 ? "fd99::1" : "10.99.0.1"));
      EXPECT_TRUE(gets_through(xdp, there->local_address(), *there));
      EXPECT_TRUE(gets_through(*there, xdp.local_address(), xdp));
    });
  }
}

TEST(XdpTransport, NamesTheRemedyWithoutLockedMemory) {
  as_root([] {
    const rlimit little{.rlim_cur = XdpSocket::kChunkBytes, .rlim_max = XdpSocket::kChunkBytes};
    ASSERT_EQ(::setrlimit(RLIMIT_MEMLOCK, &little), 0);
    keep_only({CAP_NET_RAW, CAP_NET_ADMIN, CAP_BPF});
    const std::size_t before = open_descriptors();
    // It is missed when the program is on the card already, of which nothing stays.
    for (int i = 0; i < 2; ++i) {
      EXPECT_THAT(refusal(TwoHosts::options("va", "10.99.0.1"), EPERM),
                  testing::AllOf(testing::HasSubstr("not enough locked memory (ulimit -l)"),
                                 testing::HasSubstr("cap_ipc_lock")));
      EXPECT_EQ(open_descriptors(), before);
    }
    // It is asked for before anything is opened.
    EXPECT_THROW(require_privilege(TransportKind::kXdp), IoError);
    EXPECT_EQ(open_descriptors(), before);
  });
}

TEST(XdpTransport, TakesFramesWithOptionsOfEveryLength) {
  as_root([] {
    const TwoHosts hosts;
    ASSERT_TRUE(hosts.made() && hosts.add_second_link());
    XdpTransport xdp(TwoHosts::options("vc", "10.98.0.1"));
    FrameAddresses addresses;
    addresses.ethernet =
        EthernetHeader{.to = parse_mac(find_nic("vc")->mac),
                       .from = parse_mac(hosts.there([] { return find_nic("vd")->mac; }))};
    addresses.from = *make_address("10.98.0.2", 4711);
    addresses.to = xdp.local_address();
    const auto sender = hosts.there([] { return std::make_unique<FrameSender>("vd"); });
    // The length of the header has four bits and counts its five words without options as well.
    constexpr std::size_t kMostWords = 10;
    std::vector<Bytes> sent;
    for (std::size_t words = 0; words <= kMostWords; ++words) {
      sent.push_back(payload(words, 60));
      ASSERT_TRUE(sender->send(with_options(whole_frame(addresses, sent.back()), words)));
    }
    EXPECT_EQ(receive_all(xdp, sent.size()), sent);
    EXPECT_EQ(xdp.counters().receive_errors, 0U);
  });
}

TEST(XdpTransport, NamesTheRemedyWithoutThePrivilege) {
  in_namespace([] {
    keep_only({});
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
}  // namespace interneuron::io::xdp_transport_test
