#include "node/io/stamped_socket.h"

#include <netinet/in.h>
#include <netinet/udp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "node/io/address.h"
#include "node/io/steady_clock.h"

namespace interneuron::io {
namespace {

// How long send() waits for room. The longest train has 358 kB, which leave within 10 ms from
// 300 Mbit/s on.
constexpr int kRoomWaitMs = 10;

TimePoint instant_of(const timespec& stamp) {
  const Duration wall =
      std::chrono::seconds(stamp.tv_sec) + std::chrono::nanoseconds(stamp.tv_nsec);
  return instant_of_stamp(wall, now(), wall_offset());
}

struct alignas(cmsghdr) Control {
  std::array<std::byte, 256> raw;
};

Address address_of(const in_addr& address) {
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_addr = address;
  return from_sockaddr(reinterpret_cast<const sockaddr*>(&name), sizeof name);
}

Address address_of(const in6_addr& address) {
  sockaddr_in6 name{};
  name.sin6_family = AF_INET6;
  name.sin6_addr = address;
  return from_sockaddr(reinterpret_cast<const sockaddr*>(&name), sizeof name);
}

// What the kernel says beside a datagram. True when that was the time of its arrival.
bool read_control(cmsghdr* item, StampedSocket::Received& received) {
  const auto is = [item](int level, int type) {
    return item->cmsg_level == level && item->cmsg_type == type;
  };
  if (is(SOL_SOCKET, SO_TIMESTAMPNS)) {
    received.at = instant_of(control_value<timespec>(item));
    return true;
  }
  if (is(IPPROTO_IP, IP_TTL) || is(IPPROTO_IPV6, IPV6_HOPLIMIT)) {
    received.ttl = static_cast<std::uint8_t>(std::clamp(control_value<int>(item), 0, 255));
  } else if (is(IPPROTO_IP, IP_PKTINFO)) {
    received.to = address_of(control_value<in_pktinfo>(item).ipi_spec_dst);
  } else if (is(IPPROTO_IPV6, IPV6_PKTINFO)) {
    received.to = address_of(control_value<in6_pktinfo>(item).ipi6_addr);
  }
  return false;
}

template <class Info>
void put(msghdr& header, Control& control, int level, int type, const Info& info) {
  header.msg_control = control.raw.data();
  header.msg_controllen = CMSG_SPACE(sizeof info);
  cmsghdr* item = CMSG_FIRSTHDR(&header);
  item->cmsg_level = level;
  item->cmsg_type = type;
  item->cmsg_len = CMSG_LEN(sizeof info);
  std::memcpy(CMSG_DATA(item), &info, sizeof info);
}

void put_source(msghdr& header, Control& control, const Address& source) {
  if (family_of(source) == AF_INET) {
    sockaddr_in name{};
    std::memcpy(&name, source.raw.data(), sizeof name);
    in_pktinfo info{};
    info.ipi_spec_dst = name.sin_addr;
    put(header, control, IPPROTO_IP, IP_PKTINFO, info);
  } else {
    sockaddr_in6 name{};
    std::memcpy(&name, source.raw.data(), sizeof name);
    in6_pktinfo info{};
    info.ipi6_addr = name.sin6_addr;
    put(header, control, IPPROTO_IPV6, IPV6_PKTINFO, info);
  }
}

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
    stamped |= read_control(item, received);
  }
  if (!stamped) received.at = now();
  return received;
}

int StampedSocket::send(const Address& to, ByteView bytes, const Address& source) {
  // The kernel only reads both; sendmsg shares its struct with recvmsg.
  iovec vector{const_cast<std::byte*>(bytes.data()), bytes.size()};
  Control control{};
  msghdr header{};
  header.msg_name = const_cast<std::byte*>(to.raw.data());
  header.msg_namelen = to.size;
  header.msg_iov = &vector;
  header.msg_iovlen = 1;
  if (source.size > 0) put_source(header, control, source);
  for (int attempt = 0;; ++attempt) {
    const auto sent = ::sendmsg(native_handle(), &header, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent >= 0) return 0;
    if (errno == EINTR) continue;
    const bool full = errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS;
    if (!full || attempt > 0) return errno;
    pollfd room{native_handle(), POLLOUT, 0};
    ::poll(&room, 1, kRoomWaitMs);
  }
}

}  // namespace interneuron::io
