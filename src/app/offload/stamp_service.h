// Answers STAMP test packets (RFC 8762, unauthenticated) on some NICs, on a thread of its own: what
// `road --stamp` does, so that others can measure the paths to it. Anybody who reaches the port is
// answered with one packet of the same size, so it amplifies nothing; other reflectors are not
// answered, and no source gets more than SourceLimit lets it have. On public addresses it must
// be asked for (`is_public`), since STAMP knows no keys.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace interneuron::offload {

struct StampOptions {
  // 0: no reflector.
  std::uint16_t port = 0;
  bool stateless = false;
  // Also on public addresses.
  bool is_public = false;
};
// Adds --stamp [PORT], --stamp-stateless and --stamp-public.
void add_stamp_options(CLI::App& command, StampOptions& options);

class StampService {
 public:
  // Opens a socket on every NIC that matches a pattern, on the address given or, if that is empty,
  // on all addresses of the NIC. A NIC that goes and comes back is served again within a second.
  // Throws IoError or Failure.
  StampService(const StampOptions& options, const std::vector<std::string>& patterns,
               const std::string& address);
  ~StampService();
  StampService(const StampService&) = delete;
  StampService& operator=(const StampService&) = delete;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron::offload
