#include "lab/transports/sockets.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "app/process/failure.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

[[noreturn]] void fail(const std::string& call, int error) {
  throw process::Failure(process::kFailed, call + ": " + std::strerror(error));
}

sockaddr_in socket_address(const std::string& address, std::uint16_t port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(port);
  if (::inet_pton(AF_INET, address.c_str(), &out.sin_addr) != 1) fail("address " + address, EINVAL);
  return out;
}

}  // namespace

io::FileDescriptor open_socket(int protocol) {
  const int type = protocol == IPPROTO_UDP ? SOCK_DGRAM : SOCK_STREAM;
  const int fd = ::socket(AF_INET, type | SOCK_NONBLOCK | SOCK_CLOEXEC, protocol);
  if (fd < 0) fail("socket", errno);
  return io::FileDescriptor(fd);
}

void bind_to(const io::FileDescriptor& socket, const std::string& address, std::uint16_t port) {
  const int on = 1;
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const sockaddr_in to = socket_address(address, port);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    fail("bind " + address, errno);
  }
}

void connect_to(const io::FileDescriptor& socket, const std::string& address, std::uint16_t port) {
  const sockaddr_in to = socket_address(address, port);
  const int result = ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to);
  if (result != 0 && errno != EINPROGRESS) fail("connect " + address, errno);
}

void check_connected(const io::FileDescriptor& socket) {
  int error = 0;
  socklen_t size = sizeof error;
  ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) fail("connect", error);
}

void control_congestion(const io::FileDescriptor& socket, const std::string& name) {
  const auto size = static_cast<socklen_t>(name.size());
  if (::setsockopt(socket.get(), IPPROTO_TCP, TCP_CONGESTION, name.data(), size) != 0) {
    fail("TCP_CONGESTION " + name, errno);
  }
}

void enlarge_buffers(const io::FileDescriptor& socket) {
  // Beyond the system's limit where we are root of the machine, else up to it.
  for (const int option : {SO_RCVBUF, SO_RCVBUFFORCE, SO_SNDBUF, SO_SNDBUFFORCE}) {
    ::setsockopt(socket.get(), SOL_SOCKET, option, &kBufferBytes, sizeof kBufferBytes);
  }
}

bool wait_for(std::span<pollfd> sockets, TimePoint until) {
  const Duration left = std::max(Duration{}, until - io::now());
  const timespec timeout{left / std::chrono::seconds(1), (left % std::chrono::seconds(1)).count()};
  return ::ppoll(sockets.data(), sockets.size(), &timeout, nullptr) > 0;
}

}  // namespace interneuron::transports
