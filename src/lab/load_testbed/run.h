// One scenario under load on real sockets, and the row of figures that it comes to; and all runs of
// `bench load --testbed`, one after the other.
//
// A testbed is made for the run: a host with the vehicles, one with the roadside unit, between them
// modems that share a cell. Its emulator measures the queue of that cell. Two programs of ours play
// the ends. Real time and a shared machine: figures differ from run to run.
//
// Errors: netns::TestbedError where namespaces are forbidden (5 or 77, as those commands have
// them); Failure when a program fails or a signal comes, for which a SignalWatch must be alive.
// Whatever way it ends, programs, namespaces and the files in `scratch` are gone.
// Thread-compatible.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/node_options.h"
#include "lab/load/figures.h"

namespace interneuron::load_testbed {

// Why a run with this transport cannot be made on this machine, one line; nothing: it can.
std::optional<std::string> lacks(load::Peer peer);

// Why a scenario cannot be played on the testbed; nothing: it can.
std::optional<std::string> cannot_play(const load::Scenario& scenario);

struct TestbedRow {
  load::Row row;
  // What makes the figures doubtful, one line; empty: nothing was seen.
  std::string doubt;
};

// `datagrams`: as in Transport. `scratch` is a folder for the run's files, private to it; it is
// made if it is not there.
TestbedRow run_on_testbed(const load::Scenario& scenario, TransportKind datagrams,
                          const std::filesystem::path& scratch);

// How long a run takes, about.
Duration time_of_run(const load::Scenario& scenario);

// Which loads the groups have on the testbed that let loads be chosen, unless they are: those at
// which a transport shows what it does, since each run takes as long as it lasts.
inline constexpr double kTestbedLoads[] = {1.05, 1.5};

// Runs what this machine can and tells on stderr what is left out and why, how far it is, and what
// makes a row doubtful. A SignalWatch must be alive. Throws Failure (77) when nothing is left, and
// what run_on_testbed() throws.
// `datagrams`: as in Transport.
std::vector<load::Row> run_series(const std::vector<load::Scenario>& scenarios,
                                  TransportKind datagrams);

}  // namespace interneuron::load_testbed
