#include "node/io/udp_socket.h"

#include <net/if.h>
#include <netinet/in.h>
#include <netinet/udp.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "node/io/address.h"
#include "node/io/udp_ports.h"

namespace interneuron::io {

namespace {

// The largest UDP payload over IPv4: 65535 - 20 - 8. IPv6 would allow 20 bytes more, but one limit
// is simpler.
constexpr std::size_t kMaxUdpPayload = 65507;

[[noreturn]] void fail(const std::string& what, const char* call, int error) {
  throw IoError(what + " (" + call + ": " + std::strerror(error) + ")", error);
}

bool set_int(int fd, int level, int option, int value) {
  return ::setsockopt(fd, level, option, &value, sizeof value) == 0;
}

void need_int(const UdpSocket& socket, const std::string& nic, int level, int option, int value,
              const char* name) {
  if (!set_int(socket.fd.get(), level, option, value)) {
    fail("cannot set " + std::string(name) + " on " + nic + "; Linux 5.7 or newer is needed",
         "setsockopt", errno);
  }
}

void bind_to_nic(const UdpSocket& socket, const std::string& nic) {
  if (nic.empty() || nic.size() >= IFNAMSIZ) throw UnknownNic(unknown_nic_text(nic));
  if (::setsockopt(socket.fd.get(), SOL_SOCKET, SO_BINDTODEVICE, nic.c_str(),
                   static_cast<socklen_t>(nic.size() + 1)) == 0) {
    return;
  }
  const int error = errno;
  if (error == ENODEV) throw UnknownNic(unknown_nic_text(nic));
  if (error == EPERM) {
    fail("not permitted to bind a socket to " + nic + "; use Linux 5.7 or newer, or run as root",
         "setsockopt SO_BINDTODEVICE", error);
  }
  fail("cannot bind a socket to " + nic, "setsockopt SO_BINDTODEVICE", error);
}

void never_fragment(const UdpSocket& socket, const std::string& nic, bool ipv6) {
  if (!ipv6) {
    need_int(socket, nic, IPPROTO_IP, IP_MTU_DISCOVER, IP_PMTUDISC_PROBE, "IP_MTU_DISCOVER");
    return;
  }
  need_int(socket, nic, IPPROTO_IPV6, IPV6_V6ONLY, 1, "IPV6_V6ONLY");
  need_int(socket, nic, IPPROTO_IPV6, IPV6_MTU_DISCOVER, IPV6_PMTUDISC_PROBE, "IPV6_MTU_DISCOVER");
  need_int(socket, nic, IPPROTO_IPV6, IPV6_DONTFRAG, 1, "IPV6_DONTFRAG");
}

// Returns what the kernel granted. It doubles what it is asked, for its own overhead (man 7
// socket).
std::size_t set_buffer(UdpSocket& socket, const std::string& nic, int option, int forced_option,
                       std::size_t wanted, const char* sysctl) {
  const int fd = socket.fd.get();
  const int value = static_cast<int>(std::min<std::size_t>(wanted, 1 << 30));
  // Beyond the system's limit the kernel grants it only with CAP_NET_ADMIN.
  if (!set_int(fd, SOL_SOCKET, forced_option, value)) set_int(fd, SOL_SOCKET, option, value);
  int doubled = 0;
  socklen_t size = sizeof doubled;
  if (::getsockopt(fd, SOL_SOCKET, option, &doubled, &size) != 0) return 0;
  const auto granted = static_cast<std::size_t>(std::max(doubled, 0)) / 2;
  if (granted < wanted) {
    socket.warnings.push_back("the kernel grants " + nic + " a buffer of " +
                              std::to_string(granted / 1024) + " KiB instead of " +
                              std::to_string(wanted / 1024) + "; raise it with `sysctl -w " +
                              sysctl + "=" + std::to_string(wanted) + "`");
  }
  return granted;
}

void check_owner(const Address& local, const Nic& nic) {
  if (is_unspecified(local) || is_loopback(local)) return;
  std::string text = host_text(local) + " is no address of " + nic.name;
  std::string separator = "; it has ";
  for (const Address& address : nic.addresses) {
    if (host_text(address) == host_text(local)) return;
    text += separator + host_text(address);
    separator = ", ";
  }
  if (nic.addresses.empty()) text += "; it has none";
  throw IoError(text, EADDRNOTAVAIL);
}

void bind_address(UdpSocket& socket, const UdpOptions& options) {
  sockaddr_storage address{};
  std::memcpy(&address, options.local.raw.data(), options.local.size);
  if (::bind(socket.fd.get(), reinterpret_cast<const sockaddr*>(&address), options.local.size) !=
      0) {
    const int error = errno;
    const std::string port = "port " + std::to_string(port_of(options.local)) + " on ";
    switch (error) {
      case EADDRINUSE:
        throw IoError(port + options.nic + " is taken; choose another with --port", error);
      case EACCES:
        throw IoError(port + options.nic + " needs a privilege; choose one above 1023 with --port",
                      error);
      default:
        fail("cannot bind to " + to_string(options.local) + " on " + options.nic, "bind", error);
    }
  }
  socklen_t size = sizeof address;
  if (::getsockname(socket.fd.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    fail("cannot ask for the port on " + options.nic, "getsockname", errno);
  }
  socket.local = from_sockaddr(reinterpret_cast<const sockaddr*>(&address), size);
}

}  // namespace

bool nic_vanished(int fd) {
  std::array<char, IFNAMSIZ> name{};
  socklen_t size = name.size();
  return ::getsockopt(fd, SOL_SOCKET, SO_BINDTODEVICE, name.data(), &size) != 0 && errno == ENODEV;
}

UdpSocket open_udp_socket(const UdpOptions& options) {
  const int family = family_of(options.local);
  if (family == AF_UNSPEC) throw IoError("no local address for " + options.nic, EINVAL);
  UdpSocket socket;
  socket.fd = FileDescriptor(::socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (socket.fd.get() < 0) fail("cannot open a UDP socket for " + options.nic, "socket", errno);
  bind_to_nic(socket, options.nic);

  const auto nic = options.card ? options.card : find_nic(options.nic);
  if (!nic) throw UnknownNic(unknown_nic_text(options.nic));
  check_owner(options.local, *nic);
  never_fragment(socket, options.nic, family == AF_INET6);
  if (options.answer_from_receiver && is_unspecified(options.local)) {
    if (family == AF_INET) {
      need_int(socket, options.nic, IPPROTO_IP, IP_PKTINFO, 1, "IP_PKTINFO");
    } else {
      need_int(socket, options.nic, IPPROTO_IPV6, IPV6_RECVPKTINFO, 1, "IPV6_RECVPKTINFO");
    }
  }
  // A kernel without this option costs only a counter.
  set_int(socket.fd.get(), SOL_SOCKET, SO_RXQ_OVFL, 1);
  TransportCaps& caps = socket.capabilities;
  caps.receive_buffer_bytes = set_buffer(socket, options.nic, SO_RCVBUF, SO_RCVBUFFORCE,
                                         options.receive_buffer_bytes, "net.core.rmem_max");
  caps.send_buffer_bytes = set_buffer(socket, options.nic, SO_SNDBUF, SO_SNDBUFFORCE,
                                      options.send_buffer_bytes, "net.core.wmem_max");
  caps.segmentation_offload = set_int(socket.fd.get(), SOL_UDP, UDP_SEGMENT, 0);
  caps.receive_offload = set_int(socket.fd.get(), SOL_UDP, UDP_GRO, 1);
  caps.max_datagram_bytes = kMaxUdpPayload;
  if (options.joins) {
    need_int(socket, options.nic, SOL_SOCKET, SO_REUSEPORT, 1, "SO_REUSEPORT");
  }
  bind_address(socket, options);
  note_udp_port(port_of(socket.local));
  return socket;
}

}  // namespace interneuron::io
