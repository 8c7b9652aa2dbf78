// Requests to a running holder: JSON datagrams between abstract Unix sockets, which vanish with
// their process.
//
// Any process in the same network namespace can send to the holder's socket. A request is carried
// out only when it has the token of the state file, 128 random bits that only the testbed's owner
// and root can read; all others are dropped without an answer. Datagrams are cut at 32 KiB and
// parsed as untrusted bytes. A flood of them delays honest requests, never packets for long: the
// holder reads them one at a time between its steps.
//
// Thread-compatible. Errors: TestbedError (1), or (3) for a
// testbed that refuses what ask() was given.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/time.h"
#include "netns/state/state.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// A change of some links, or what cells measure, from now on.
struct Request {
  // Indices into State::links.
  std::vector<std::size_t> links;
  // Each KEY=VALUE as emu::parse_change reads it.
  std::vector<std::string> settings;
  // When above 0, nothing passes for this long.
  Duration outage{};
  // What cells measure of their queues begins anew.
  bool measure_cells = false;
};

// The request in a datagram; nothing for any bytes that are none, or that lack the token. Pure.
std::optional<Request> parse_request(std::string_view datagram, const std::string& token);

// The holder's end: receives requests and answers each before it receives the next.
class ControlServer {
 public:
  // Binds a socket in the caller's network namespace, where clients must be as well, and draws the
  // token.
  ControlServer();

  const std::string& name() const { return name_; }
  const std::string& token() const { return token_; }
  int fd() const { return socket_.get(); }

  // The next request, if one waits. A datagram that is no request, or lacks the token, is dropped
  // and gives an empty result. reply() answers the request: an empty text for done, else what is
  // wrong with it.
  std::optional<Request> receive();
  void reply(const std::string& error);

 private:
  io::FileDescriptor socket_;
  std::string name_;
  std::string token_;
  // The abstract name of the socket that the last request came from.
  std::string client_;
};

// Sends a request to the holder and waits for the answer, at most 5 s. Throws TestbedError: (3)
// with what the holder found wrong with the request, (1) without an answer.
void ask(const State& state, const Request& request);

}  // namespace interneuron::netns
