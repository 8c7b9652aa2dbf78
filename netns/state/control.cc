#include "netns/state/control.h"

#include <poll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cstddef>
#include <cstring>

#include "netns/state/check.h"
#include "netns/state/json.h"

namespace interneuron::netns {

namespace {

// The most bytes of a request: some settings, each of which is a path of 4096 bytes at most.
constexpr std::size_t kMaxMessage = 32768;
// How long ask() waits. The holder answers between two of its steps, which are 10 ms long; no
// measurement is behind this value, which only has to be larger on a loaded machine.
constexpr int kAnswerBoundMs = 5000;

struct Address {
  sockaddr_un data{};
  socklen_t size = 0;
};

// An abstract address begins with a zero byte and has no place in the file system.
Address abstract_address(const std::string& name) {
  Address out;
  out.data.sun_family = AF_UNIX;
  const std::size_t length = std::min(name.size(), sizeof out.data.sun_path - 1);
  std::memcpy(out.data.sun_path + 1, name.data(), length);
  out.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + length);
  return out;
}

io::FileDescriptor open_socket(int flags) {
  return io::FileDescriptor(
      check(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | flags, 0), "open a control socket"));
}

// 128 random bits as 32 hexadecimal digits.
std::string random_hex() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    fail_errno("draw random numbers");
  }
  constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (const unsigned char byte : bytes) {
    out += kDigits[byte >> 4U];
    out += kDigits[byte & 15U];
  }
  return out;
}

// The abstract name in an address; empty when it has none, as of a socket that is not bound.
std::string name_of(const sockaddr_un& address, socklen_t size) {
  const std::size_t start = offsetof(sockaddr_un, sun_path) + 1;
  return size > start ? std::string(address.sun_path + 1, size - start) : std::string();
}

// Bytes that are not UTF-8 are replaced; the holder then refuses the setting and names it.
std::string to_text(const Request& request, const std::string& token) {
  const Json json{{"token", token},
                  {"links", request.links},
                  {"settings", request.settings},
                  {"outage_ns", request.outage.count()},
                  {"measure_cells", request.measure_cells}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// Throws std::exception for anything but a request with the right token.
Request from_json(const Json& object, const std::string& token) {
  if (object.at("token").get<std::string>() != token) throw std::runtime_error("not authorised");
  Request out;
  for (const Json& link : array(object.at("links")))
    out.links.push_back(integer<std::size_t>(link));
  out.settings = object.at("settings").get<std::vector<std::string>>();
  out.outage = Duration{integer<std::int64_t>(object.at("outage_ns"))};
  out.measure_cells = object.at("measure_cells").get<bool>();
  return out;
}

}  // namespace

std::optional<Request> parse_request(std::string_view datagram, const std::string& token) {
  try {
    return from_json(Json::parse(datagram), token);
  } catch (const std::exception&) {
    // Not a request of the testbed's owner.
    return std::nullopt;
  }
}

ControlServer::ControlServer()
    : socket_(open_socket(SOCK_NONBLOCK)),
      name_("interneuron/" + random_hex()),
      token_(random_hex()) {
  const Address address = abstract_address(name_);
  check(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address.data), address.size),
        "bind a control socket");
}

std::optional<Request> ControlServer::receive() {
  std::array<char, kMaxMessage> buffer{};
  sockaddr_un from{};
  socklen_t from_size = sizeof from;
  const ssize_t size = ::recvfrom(socket_.get(), buffer.data(), buffer.size(), 0,
                                  reinterpret_cast<sockaddr*>(&from), &from_size);
  if (size <= 0) return std::nullopt;
  auto request = parse_request({buffer.data(), static_cast<std::size_t>(size)}, token_);
  if (request) client_ = name_of(from, from_size);
  return request;
}

void ControlServer::reply(const std::string& error) {
  const Address to = abstract_address(client_);
  // The answer is lost when the client no longer waits for it.
  ::sendto(socket_.get(), error.data(), error.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
           reinterpret_cast<const sockaddr*>(&to.data), to.size);
}

void ask(const State& state, const Request& request) {
  const io::FileDescriptor socket = open_socket(0);
  // Bound to an address of the family alone, a socket gets an abstract name from the kernel.
  const sa_family_t family = AF_UNIX;
  check(::bind(socket.get(), reinterpret_cast<const sockaddr*>(&family), sizeof family),
        "bind a control socket");
  const std::string message = to_text(request, state.control_token);
  const Address to = abstract_address(state.control);
  if (::sendto(socket.get(), message.data(), message.size(), MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(&to.data), to.size) < 0) {
    throw TestbedError(1, "testbed '" + state.name +
                              "' cannot be reached; is it up, and are you outside its hosts?");
  }
  pollfd answered{socket.get(), POLLIN, 0};
  std::array<char, kMaxMessage> buffer{};
  if (::poll(&answered, 1, kAnswerBoundMs) <= 0) {
    throw TestbedError(1, "testbed '" + state.name + "' does not answer");
  }
  const ssize_t size = ::recv(socket.get(), buffer.data(), buffer.size(), 0);
  if (size > 0) throw TestbedError(3, std::string(buffer.data(), static_cast<std::size_t>(size)));
}

}  // namespace interneuron::netns
