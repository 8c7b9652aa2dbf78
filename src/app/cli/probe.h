// `interneuron probe`: pings and trains to a roadside unit or any STAMP reflector, over every NIC
// at once.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/settings/key_options.h"

namespace interneuron::cli {

struct ProbeOptions {
  // HOST[:PORT], the peer of every NIC that names none itself.
  std::string peer;
  // NIC[=HOST[:PORT]], a name or a pattern (node/io/nic_choice.h); none: every one that is ready.
  std::vector<std::string> nics;
  // Packets per NIC; 0: until interrupted.
  std::size_t count = 250;
  double interval_ms = 20;
  double timeout_ms = 1000;
  // UDP payload, bytes.
  std::size_t size = 100;
  bool no_rate = false;
  // Who we are and who the roadside unit is; not with `stamp`.
  settings::KeyOptions keys;
  // The port of a STAMP reflector; without, our own packets are sent.
  std::optional<std::uint16_t> stamp;
  bool json = false;
  bool json_stream = false;
};

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_probe(CLI::App& program, std::function<int()>& run);
// Measures, prints and returns the exit code: 1 when a NIC got no reply. Throws Failure or IoError.
int run_probe(const ProbeOptions& options);

}  // namespace interneuron::cli
