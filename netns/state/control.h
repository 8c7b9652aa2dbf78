// Requests to a running holder: datagrams between abstract Unix sockets, which vanish with their
// process. A request is believed when it carries the token of the state file, which only the owner
// and root can read. Errors: TestbedError (1). Thread-compatible.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/io/file_descriptor.h"
#include "interneuron/time.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// What may be asked of the links `links` (indices into State::links).
struct Request {
  std::vector<std::size_t> links;
  std::vector<std::string> settings;  // KEY=VALUE, see emu::parse_change
  Duration outage{};                  // > 0: nothing passes for this long
};

class ControlServer {
 public:
  // In the namespace of the caller, where clients must be as well.
  ControlServer();

  const std::string& name() const { return name_; }
  const std::string& token() const { return token_; }
  int fd() const { return socket_.get(); }

  // The next request, if one waits; what is none, or has no token, is dropped. reply() answers it:
  // empty for done, else what is wrong.
  std::optional<Request> receive();
  void reply(const std::string& error);

 private:
  io::FileDescriptor socket_;
  std::string name_;
  std::string token_;
  std::string client_;  // abstract name of who asked last
};

// Sends a request and waits for the answer (at most 5 s); throws TestbedError (3) with what the
// holder found wrong in it.
void ask(const State& state, const Request& request);

}  // namespace interneuron::netns
