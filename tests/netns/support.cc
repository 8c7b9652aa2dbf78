#include "support.h"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "netns/state/error.h"
#include "netns/testbed/testbed.h"

namespace interneuron::netns {

namespace {

using Clock = std::chrono::steady_clock;

void require(bool fine, const char* what) {
  if (!fine) throw std::runtime_error(std::string(what) + ": " + std::strerror(errno));
}

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
};

// Parses an address of either family.
SocketAddress address_of(const std::string& address, int port) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  require(::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found) == 0,
          "address");
  SocketAddress out{.size = found->ai_addrlen};
  std::memcpy(&out.storage, found->ai_addr, out.size);
  ::freeaddrinfo(found);
  return out;
}

io::FileDescriptor make_socket(const UdpOptions& options) {
  const SocketAddress local = address_of(options.address, options.port);
  io::FileDescriptor fd(::socket(local.storage.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  require(fd.get() >= 0, "socket");
  require(::setsockopt(fd.get(), SOL_SOCKET, SO_BINDTODEVICE, options.nic.c_str(),
                       static_cast<socklen_t>(options.nic.size() + 1)) == 0,
          "bind to device");
  // A stalled link empties all at once. Real root may exceed the system's limit, else that holds.
  constexpr int kSocketBufferBytes = 16 << 20;
  for (const int option : {SO_RCVBUF, SO_RCVBUFFORCE}) {
    ::setsockopt(fd.get(), SOL_SOCKET, option, &kSocketBufferBytes, sizeof kSocketBufferBytes);
  }
  require(::bind(fd.get(), local.get(), local.size) == 0, "bind");
  if (options.peer.empty()) return fd;
  const SocketAddress remote = address_of(options.peer, options.port);
  require(::connect(fd.get(), remote.get(), remote.size) == 0, "connect");
  return fd;
}

// SCM_RIGHTS (unix(7)).
struct FdMessage {
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  char byte = 'x';
  iovec data{&byte, 1};
  msghdr header{};

  FdMessage() {
    header.msg_iov = &data;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
  }
};

void send_fd(int channel, int fd) {
  FdMessage message;
  cmsghdr* item = CMSG_FIRSTHDR(&message.header);
  item->cmsg_level = SOL_SOCKET;
  item->cmsg_type = SCM_RIGHTS;
  item->cmsg_len = CMSG_LEN(sizeof fd);
  std::memcpy(CMSG_DATA(item), &fd, sizeof fd);
  require(::sendmsg(channel, &message.header, 0) == 1, "pass a socket");
}

io::FileDescriptor receive_fd(int channel) {
  FdMessage message;
  require(::recvmsg(channel, &message.header, MSG_CMSG_CLOEXEC) == 1, "receive a socket");
  int fd = -1;
  std::memcpy(&fd, CMSG_DATA(CMSG_FIRSTHDR(&message.header)), sizeof fd);
  return io::FileDescriptor(fd);
}

}  // namespace

RuntimeDir::RuntimeDir() {
  std::string name = std::filesystem::temp_directory_path() / "interneuron-netns-XXXXXX";
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp");
  path_ = name;
}

RuntimeDir::~RuntimeDir() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

TestbedOptions clean_options(const RuntimeDir& dir) {
  return TestbedOptions{.scenario = scenario_of({"clean"}, 1), .runtime_dir = dir.path()};
}

std::optional<std::string> why_not() {
  static const std::optional<std::string> reason = []() -> std::optional<std::string> {
    const RuntimeDir dir;
    try {
      Testbed::up(clean_options(dir));
    } catch (const TestbedError& error) {
      if (error.exit_code == 5) return error.what();
    }
    return std::nullopt;
  }();
  return reason;
}

bool eventually(const std::function<bool()>& condition, std::chrono::milliseconds bound) {
  const auto end = Clock::now() + bound;
  while (!condition()) {
    if (Clock::now() > end) return false;
    ::poll(nullptr, 0, 1);
  }
  return true;
}

int in_child(const std::function<int()>& body) {
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      ::_exit(body());
    } catch (const std::exception& error) {
      std::fprintf(stderr, "child: %s\n", error.what());
      ::_exit(255);
    }
  }
  int status = 0;
  if (::waitpid(child, &status, 0) != child) throw std::runtime_error("waitpid");
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

std::string output_of(const State& state, Host host, const std::vector<std::string>& argv,
                      int* code) {
  std::array<int, 2> ends{};
  require(::pipe2(ends.data(), O_CLOEXEC) == 0, "pipe");
  const io::FileDescriptor read_end(ends[0]);
  pid_t child = 0;
  {
    const io::FileDescriptor write_end(ends[1]);
    child = Testbed::spawn(state, host, argv, {{-1, write_end.get(), -1}, true});
  }
  std::string out;
  std::array<char, 4096> buffer{};
  ssize_t count = 0;
  while ((count = ::read(read_end.get(), buffer.data(), buffer.size())) > 0) {
    out.append(buffer.data(), static_cast<std::size_t>(count));
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (code != nullptr) *code = WEXITSTATUS(status);
  return out;
}

io::FileDescriptor udp_socket_in(const State& state, Host host, const UdpOptions& options) {
  std::array<int, 2> ends{};
  require(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, ends.data()) == 0, "socketpair");
  const io::FileDescriptor ours(ends[0]);
  const io::FileDescriptor childs(ends[1]);
  const int code = in_child([&] {
    Testbed::enter(state, host);
    const io::FileDescriptor made = make_socket(options);
    send_fd(childs.get(), made.get());
    return 0;
  });
  if (code != 0) throw std::runtime_error("no socket in the testbed");
  return receive_fd(ours.get());
}

UdpPair udp_pair(const State& state, std::size_t index, int port) {
  const TestbedLink& link = state.links.at(index);
  return {udp_socket_in(state, kVehicle, {link.nic, link.vehicle_address, link.road_address, port}),
          udp_socket_in(state, kRoad, {link.nic, link.road_address, link.vehicle_address, port})};
}

bool readable(int fd, int bound_ms) {
  pollfd item{fd, POLLIN, 0};
  return ::poll(&item, 1, bound_ms) > 0;
}

}  // namespace interneuron::netns
