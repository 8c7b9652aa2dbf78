// `interneuron probe`: pings and trains to a roadside unit or any STAMP reflector, over every NIC
// at once.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace interneuron::cli {

struct ProbeOptions {
  std::string peer;  // HOST[:PORT]; of every NIC that names none itself
  // NIC[=HOST[:PORT]], a name or a pattern (host/io/nic_choice.h); none: every one that is ready.
  std::vector<std::string> nics;
  std::size_t count = 250;  // 0: until interrupted
  double interval_ms = 20;
  double timeout_ms = 1000;
  std::size_t size = 100;  // UDP payload, bytes
  bool no_rate = false;
  std::optional<std::uint16_t> stamp;  // port of a STAMP reflector; without: our own packets
  bool json = false;
  bool json_stream = false;
};

void add_probe(CLI::App& program, std::function<int()>& run);
int run_probe(const ProbeOptions& options);

}  // namespace interneuron::cli
