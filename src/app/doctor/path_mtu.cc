#include "app/doctor/measurements.h"

#include <linux/errqueue.h>
#include <netinet/icmp6.h>
#include <netinet/in.h>
#include <netinet/ip.h>
#include <netinet/ip_icmp.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "interneuron/sizes.h"
#include "node/io/file_descriptor.h"
#include "node/io/steady_clock.h"

namespace interneuron::doctor {

namespace {

using namespace std::chrono_literals;

// UDP payloads that are tried: 1200 must always pass; 1280, 1358, 1428, 1472 are what tunnels and
// carriers are known to leave; 1400 is our largest.
constexpr std::array<std::size_t, 6> kPayloads = {1200, 1280, 1358, kMaxDatagramBytes, 1428, 1472};
constexpr std::size_t kUdpHeaderBytes = 8;
constexpr std::size_t kIcmpHeaderBytes = 8;
// A size counts as unanswered after so many requests: at 5 % loss all three are lost once in 8,000.
constexpr int kTries = 3;
// A mobile network answers within this when it answers at all: the largest round trip of the
// paper's network table is 994 ms.
constexpr Duration kWait = 1s;

std::size_t ip_header_bytes(bool ipv6) { return ipv6 ? 40 : 20; }

// A socket for echo requests: an unprivileged one of the kernel's where net.ipv4.ping_group_range
// allows that, else a raw one, which needs CAP_NET_RAW. The sizes of packets that come in are
// checked before they are read.
class Echo {
 public:
  Echo(const std::string& nic, const Address& host) : host_(host), ipv6_(is_ipv6(host)) {
    const int family = ipv6_ ? AF_INET6 : AF_INET;
    const int protocol = ipv6_ ? static_cast<int>(IPPROTO_ICMPV6) : static_cast<int>(IPPROTO_ICMP);
    socket_ = io::FileDescriptor(::socket(family, SOCK_DGRAM | SOCK_CLOEXEC, protocol));
    if (socket_.get() < 0) {
      raw_ = true;
      socket_ = io::FileDescriptor(::socket(family, SOCK_RAW | SOCK_CLOEXEC, protocol));
    }
    if (socket_.get() < 0) {
      error_ = errno;
      return;
    }
    const auto size = static_cast<socklen_t>(nic.size());
    if (::setsockopt(socket_.get(), SOL_SOCKET, SO_BINDTODEVICE, nic.data(), size) != 0) {
      error_ = errno;
      return;
    }
    const int on = 1;
    if (ipv6_) {
      const int probe = IPV6_PMTUDISC_PROBE;
      ::setsockopt(socket_.get(), IPPROTO_IPV6, IPV6_MTU_DISCOVER, &probe, sizeof probe);
      ::setsockopt(socket_.get(), IPPROTO_IPV6, IPV6_RECVERR, &on, sizeof on);
    } else {
      const int probe = IP_PMTUDISC_PROBE;
      ::setsockopt(socket_.get(), IPPROTO_IP, IP_MTU_DISCOVER, &probe, sizeof probe);
      ::setsockopt(socket_.get(), IPPROTO_IP, IP_RECVERR, &on, sizeof on);
    }
  }
  int error() const { return error_; }
  const std::optional<std::size_t>& told() const { return told_; }

  // Whether an echo of `bytes` at the IP layer comes back.
  bool answered(std::size_t bytes) {
    for (int i = 0; i < kTries; ++i) {
      if (!send(bytes)) {
        if (errno == EMSGSIZE) return false;
        // The error of an earlier packet.
        continue;
      }
      if (wait()) return true;
    }
    return false;
  }

 private:
  bool send(std::size_t bytes) {
    ++sequence_;
    std::vector<std::byte> packet(bytes - ip_header_bytes(ipv6_));
    // icmp6_hdr has the same layout.
    icmphdr header{};
    header.type = ipv6_ ? static_cast<std::uint8_t>(ICMP6_ECHO_REQUEST)
                        : static_cast<std::uint8_t>(ICMP_ECHO);
    // On an unprivileged socket the kernel replaces the id by its own.
    header.un.echo.id = kRawId;
    header.un.echo.sequence = htons(sequence_);
    std::memcpy(packet.data(), &header, sizeof header);
    if (!ipv6_) set_checksum(packet);
    const ssize_t sent = ::sendto(socket_.get(), packet.data(), packet.size(), 0,
                                  reinterpret_cast<const sockaddr*>(host_.raw.data()), host_.size);
    return sent == static_cast<ssize_t>(packet.size());
  }

  // The checksum of RFC 1071; for IPv6 the kernel computes it.
  static void set_checksum(std::vector<std::byte>& packet) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < packet.size(); ++i) {
      sum += std::to_integer<std::uint32_t>(packet[i]) << (i % 2 == 0 ? 8 : 0);
    }
    while (sum >> 16 != 0) sum = (sum & 0xffff) + (sum >> 16);
    const auto value = htons(static_cast<std::uint16_t>(~sum));
    std::memcpy(packet.data() + 2, &value, sizeof value);
  }

  // Waits for the answer to the newest request.
  bool wait() {
    const TimePoint end = io::now() + kWait;
    for (Duration left = kWait; left > Duration::zero(); left = end - io::now()) {
      pollfd item{socket_.get(), POLLIN, 0};
      const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(left).count() + 1;
      if (::poll(&item, 1, static_cast<int>(ms)) <= 0) continue;
      if ((item.revents & POLLERR) != 0 && read_error()) return false;
      if ((item.revents & POLLIN) != 0 && is_answer()) return true;
    }
    return false;
  }

  bool is_answer() {
    std::array<std::byte, 65536> packet;
    const ssize_t size = ::recv(socket_.get(), packet.data(), packet.size(), MSG_DONTWAIT);
    if (size <= 0) return false;
    std::size_t at = 0;
    if (raw_ && !ipv6_) at = (std::to_integer<std::size_t>(packet[0]) & 0xf) * 4;
    icmphdr header{};
    if (size < static_cast<ssize_t>(at + sizeof header)) return false;
    std::memcpy(&header, packet.data() + at, sizeof header);
    const int reply = ipv6_ ? static_cast<int>(ICMP6_ECHO_REPLY) : static_cast<int>(ICMP_ECHOREPLY);
    return header.type == reply && header.un.echo.sequence == htons(sequence_) &&
           (!raw_ || header.un.echo.id == kRawId);
  }

  // True when a router said that the packet was too large; the size that it named is kept.
  bool read_error() {
    std::array<std::byte, 512> control;
    std::array<std::byte, 64> data;
    iovec part{data.data(), data.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    bool too_large = false;
    while (::recvmsg(socket_.get(), &message, MSG_ERRQUEUE | MSG_DONTWAIT) >= 0) {
      for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
        const bool ours = (c->cmsg_level == SOL_IP && c->cmsg_type == IP_RECVERR) ||
                          (c->cmsg_level == SOL_IPV6 && c->cmsg_type == IPV6_RECVERR);
        if (!ours) continue;
        sock_extended_err error{};
        std::memcpy(&error, CMSG_DATA(c), sizeof error);
        if (error.ee_errno != EMSGSIZE) continue;
        told_ = std::min<std::size_t>(told_.value_or(error.ee_info), error.ee_info);
        too_large = true;
      }
      message.msg_controllen = control.size();
    }
    return too_large;
  }

  static constexpr std::uint16_t kRawId = 0x494e;
  Address host_;
  bool ipv6_;
  bool raw_ = false;
  io::FileDescriptor socket_;
  int error_ = 0;
  std::uint16_t sequence_ = 0;
  std::optional<std::size_t> told_;
};

}  // namespace

PathMtu probe_path_mtu(const std::string& nic, std::size_t mtu, const Address& host) {
  PathMtu out;
  out.nic = nic;
  Echo echo(nic, host);
  out.error = echo.error();
  if (out.error != 0) return out;
  const std::size_t headers = ip_header_bytes(is_ipv6(host)) + kUdpHeaderBytes;
  // UDP payloads and echo payloads of the same size make IP packets of the same size.
  static_assert(kUdpHeaderBytes == kIcmpHeaderBytes);
  std::vector<std::size_t> sizes;
  for (const std::size_t payload : kPayloads) sizes.push_back(payload + headers);
  // Jumbo frames do not matter here: our datagrams are smaller.
  if (mtu < sizes.back()) sizes.push_back(mtu);
  std::erase_if(sizes, [mtu](std::size_t size) { return size > mtu; });
  std::ranges::sort(sizes);
  sizes.erase(std::unique(sizes.begin(), sizes.end()), sizes.end());
  for (const std::size_t size : sizes) {
    out.probes.push_back({size, echo.answered(size)});
    // Larger packets will not fit either, and a host that does not answer the smallest answers
    // none.
    if (!out.probes.back().answered) break;
  }
  out.told = echo.told();
  return out;
}

}  // namespace interneuron::doctor
