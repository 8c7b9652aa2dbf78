#include "app/settings/peer_address.h"

#include <netdb.h>

#include <charconv>
#include <optional>

#include "app/process/failure.h"
#include "node/io/address.h"

namespace interneuron::settings {

namespace {

std::string without_brackets(const std::string& host) {
  const bool bracketed = host.starts_with('[') && host.ends_with(']');
  return bracketed ? host.substr(1, host.size() - 2) : host;
}

std::optional<std::uint16_t> port_from(const std::string& text) {
  std::uint16_t port = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, port);
  if (error != std::errc{} || rest != end || port == 0) return std::nullopt;
  return port;
}

}  // namespace

Address resolve_peer(const std::string& text, const std::string& option,
                     std::uint16_t default_port) {
  const process::Failure malformed(process::kUsage,
                                   option + " '" + text +
                                       "': give HOST or HOST:PORT, for example 192.0.2.7, "
                                       "[2001:db8::7]:47000 or road.example:47000");
  auto address = parse_address(text);
  if (!address) address = make_address(without_brackets(text), default_port);
  if (address) {
    if (port_of(*address) == 0 || is_unspecified(*address)) throw malformed;
    return *address;
  }
  const std::size_t colon = text.rfind(':');
  const std::string host = text.substr(0, colon);
  const auto port = colon == std::string::npos ? default_port : port_from(text.substr(colon + 1));
  if (!port || host.empty() || host.find_first_of("[]:") != std::string::npos) throw malformed;
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), std::to_string(*port).c_str(), &hints, &found);
  if (error != 0 || found == nullptr) {
    throw process::Failure(process::kFailed,
                           option + " '" + text + "': " + ::gai_strerror(error) +
                               "; give an address like 192.0.2.7:" + std::to_string(*port));
  }
  const Address resolved = io::from_sockaddr(found->ai_addr, found->ai_addrlen);
  ::freeaddrinfo(found);
  return resolved;
}

}  // namespace interneuron::settings
