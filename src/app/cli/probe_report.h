// What a probe found, for people and for programs.
#pragma once

#include <string>
#include <vector>

#include "app/cli/probe.h"
#include "app/records/run_files.h"
#include "core/probe/measurement.h"

namespace interneuron::cli {

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
