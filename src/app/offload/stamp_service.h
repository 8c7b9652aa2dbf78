// A STAMP reflector (RFC 8762, unauthenticated) on some NICs, on a thread of its own: `road
// --stamp`.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace interneuron::cli {

struct StampOptions {
  std::uint16_t port = 0;  // 0: no reflector
  bool stateless = false;
  bool insecure = false;  // on public addresses too
};
// --stamp [PORT], --stamp-stateless.
void add_stamp_options(CLI::App& command, StampOptions& options);

class StampService {
 public:
  // Opens a socket on every NIC, for the address given or all of the NIC's. A NIC that goes and
  // comes back is served again within a second. Throws IoError or Failure.
  StampService(const StampOptions& options, const std::vector<std::string>& patterns,
               const std::string& address);
  ~StampService();
  StampService(const StampService&) = delete;
  StampService& operator=(const StampService&) = delete;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron::cli
