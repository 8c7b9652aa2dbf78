#include "tests/netns/attacker/confined.h"

#include <arpa/inet.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "node/io/steady_clock.h"

namespace interneuron::attacker {
namespace {

// Floods must not lose at the socket what the test counts on; as for the library's own sockets.
constexpr int kBufferBytes = 4 * 1024 * 1024;

sockaddr_in to_sockaddr(Place place) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(place.port);
  out.sin_addr.s_addr = htonl(place.host);
  return out;
}

// Its number; 0 where it may not be seen.
ino_t namespace_of(const std::string& file) {
  struct stat found {};
  return ::stat(file.c_str(), &found) == 0 ? found.st_ino : 0;
}

bool is_named(ino_t network) {
  std::error_code unreadable;
  for (const auto& entry : std::filesystem::directory_iterator("/run/netns", unreadable)) {
    if (namespace_of(entry.path()) == network) return true;
  }
  return false;
}

// A line for each route: NIC, destination, gateway and more.
bool has_default_route() {
  std::ifstream routes("/proc/self/net/route");
  for (std::string line; std::getline(routes, line);) {
    std::istringstream fields(line);
    std::string nic;
    std::string destination;
    if (fields >> nic >> destination && destination == "00000000") return true;
  }
  return false;
}

std::string driver_of(const std::string& nic) {
  const io::FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ethtool_drvinfo info{};
  info.cmd = ETHTOOL_GDRVINFO;
  ifreq request{};
  if (nic.size() >= sizeof request.ifr_name) return {};
  nic.copy(request.ifr_name, nic.size());
  request.ifr_data = reinterpret_cast<char*>(&info);
  if (socket.get() < 0 || ::ioctl(socket.get(), SIOCETHTOOL, &request) != 0) return {};
  return {info.driver, ::strnlen(info.driver, sizeof info.driver)};
}

}  // namespace

void fail_call(const std::string& call) {
  throw std::runtime_error(call + ": " + std::strerror(errno));
}

std::uint32_t parse_host(const std::string& text) {
  in_addr address{};
  if (::inet_pton(AF_INET, text.c_str(), &address) != 1) {
    throw std::runtime_error("'" + text + "' is no IPv4 address like 10.0.0.1");
  }
  return ntohl(address.s_addr);
}

Place parse_place(const std::string& text) {
  const std::size_t colon = text.find(':');
  const int port = colon == std::string::npos ? 0 : std::atoi(text.c_str() + colon + 1);
  if (port < 1 || port > UINT16_MAX) {
    throw std::runtime_error("'" + text + "' is no place like 10.0.0.1:47000");
  }
  return {parse_host(text.substr(0, colon)), static_cast<std::uint16_t>(port)};
}

std::string to_string(Place place) {
  const in_addr address{htonl(place.host)};
  char text[INET_ADDRSTRLEN] = {};
  ::inet_ntop(AF_INET, &address, text, sizeof text);
  return std::string(text) + ":" + std::to_string(place.port);
}

// Three locks, since each alone has a hole: a container has a first process of its own, its NIC is
// a veth too, and whoever is no root may not look at the first process.
void require_confined(const std::string& nic) {
  const ino_t own = namespace_of("/proc/self/ns/net");
  if (own == 0 || own == namespace_of("/proc/1/ns/net") || !is_named(own)) {
    throw std::runtime_error("refused: this network namespace was not made by `ip netns add`");
  }
  if (driver_of(nic) != "veth") {
    throw std::runtime_error("refused: NIC '" + nic + "' is no veth");
  }
  if (has_default_route()) {
    throw std::runtime_error("refused: this network namespace has a route to everywhere");
  }
}

io::FileDescriptor open_udp(const std::string& nic, Place from, const Place* to) {
  io::FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (socket.get() < 0) fail_call("socket");
  if (::setsockopt(socket.get(), SOL_SOCKET, SO_BINDTODEVICE, nic.c_str(),
                   static_cast<socklen_t>(nic.size())) != 0) {
    fail_call("SO_BINDTODEVICE " + nic);
  }
  ::setsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &kBufferBytes, sizeof kBufferBytes);
  const sockaddr_in local = to_sockaddr(from);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&local), sizeof local) != 0) {
    fail_call("bind to " + to_string(from));
  }
  if (to == nullptr) return socket;
  const sockaddr_in remote = to_sockaddr(*to);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&remote), sizeof remote) != 0) {
    fail_call("connect to " + to_string(*to));
  }
  return socket;
}

TimePoint now() { return io::now(); }

double seconds_between(TimePoint from, TimePoint to) { return to_seconds(to - from); }

}  // namespace interneuron::attacker
