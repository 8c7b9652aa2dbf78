// What `interneuron probe` does: pings and trains to a roadside unit or any STAMP reflector, over
// every NIC at once; and what it found, for people and for programs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/records/json_file.h"
#include "app/settings/key_options.h"
#include "core/probe/measurement.h"

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

// Measures, prints and returns the exit code: 1 when a NIC got no reply. Throws Failure or IoError.
int run_probe(const ProbeOptions& options);

struct ProbedNic {
  std::string nic;
  std::string peer;
  std::string local;
  probe::Summary summary;
  // Why the NIC measured nothing, one line with the remedy; empty when the peer answered.
  std::string problem;
};

// schema interneuron.probe/1
records::Json probe_json(const ProbeOptions& options, const std::vector<ProbedNic>& nics);
// One line of --json-stream, schema interneuron.probe.reply/1.
records::Json reply_json(const std::string& nic, const probe::Reply& reply);
void print_probe_table(const ProbeOptions& options, const std::vector<ProbedNic>& nics);

}  // namespace interneuron::cli
