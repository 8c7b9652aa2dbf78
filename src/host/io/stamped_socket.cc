#include "host/io/stamped_socket.h"

#include <netinet/in.h>
#include <netinet/udp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "host/io/address.h"
#include "host/io/steady_clock.h"

namespace interneuron::io {
namespace {

// How long send() waits for room. The longest train has 358 kB, which leave within 10 ms from
// 300 Mbit/s on.
constexpr int kRoomWaitMs = 10;

// The kernel stamps with CLOCK_REALTIME; only the age of the stamp is used, so that a step of that
// clock spoils one datagram and no more.
TimePoint instant_of(const timespec& stamp) {
  const TimePoint at = now();
  const Duration wall =
      std::chrono::seconds(stamp.tv_sec) + std::chrono::nanoseconds(stamp.tv_nsec);
  const Duration age = at.time_since_epoch() + wall_offset() - wall;
  // A stamp that is older than any time-out or from the future means that the clock was set.
  return age < Duration::zero() || age > std::chrono::seconds(10) ? at : at - age;
}

struct alignas(cmsghdr) Control {
  std::array<std::byte, 256> raw;
};

}  // namespace

StampedSocket::StampedSocket(const UdpOptions& options) : socket_(open_udp_socket(options)) {
  const int on = 1;
  const int off = 0;
  const int fd = native_handle();
  // A kernel that lacks one of these options costs precision only.
  ::setsockopt(fd, SOL_UDP, UDP_GRO, &off, sizeof off);
  ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  const bool ipv6 = family_of(options.local) == AF_INET6;
  ::setsockopt(fd, ipv6 ? IPPROTO_IPV6 : IPPROTO_IP, ipv6 ? IPV6_RECVHOPLIMIT : IP_RECVTTL, &on,
               sizeof on);
}

std::optional<StampedSocket::Received> StampedSocket::receive() {
  iovec vector{buffer_.data(), buffer_.size()};
  sockaddr_storage name{};
  Control control;
  msghdr header{};
  header.msg_name = &name;
  header.msg_namelen = sizeof name;
  header.msg_iov = &vector;
  header.msg_iovlen = 1;
  header.msg_control = control.raw.data();
  header.msg_controllen = control.raw.size();
  ssize_t size = 0;
  do {
    size = ::recvmsg(native_handle(), &header, MSG_DONTWAIT);
  } while (size < 0 && errno == EINTR);
  if (size < 0) return std::nullopt;
  Received received;
  received.from = from_sockaddr(reinterpret_cast<const sockaddr*>(&name), header.msg_namelen);
  received.bytes = ByteView(buffer_).first(static_cast<std::size_t>(size));
  bool stamped = false;
  for (cmsghdr* item = CMSG_FIRSTHDR(&header); item != nullptr; item = CMSG_NXTHDR(&header, item)) {
    if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(item), sizeof stamp);
      received.at = instant_of(stamp);
      stamped = true;
    } else if ((item->cmsg_level == IPPROTO_IP && item->cmsg_type == IP_TTL) ||
               (item->cmsg_level == IPPROTO_IPV6 && item->cmsg_type == IPV6_HOPLIMIT)) {
      int ttl = 0;
      std::memcpy(&ttl, CMSG_DATA(item), sizeof ttl);
      received.ttl = static_cast<std::uint8_t>(std::clamp(ttl, 0, 255));
    }
  }
  if (!stamped) received.at = now();
  return received;
}

int StampedSocket::send(const Address& to, ByteView bytes) {
  for (int attempt = 0;; ++attempt) {
    const auto sent =
        ::sendto(native_handle(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                 reinterpret_cast<const sockaddr*>(to.raw.data()), to.size);
    if (sent >= 0) return 0;
    if (errno == EINTR) continue;
    const bool full = errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS;
    if (!full || attempt > 0) return errno;
    pollfd room{native_handle(), POLLOUT, 0};
    ::poll(&room, 1, kRoomWaitMs);
  }
}

}  // namespace interneuron::io
