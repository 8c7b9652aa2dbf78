// A comparison of peers on the testbed (docs/peers.md): its runs, the figures they come to, what a
// quick one leaves out, and the page of what a full one found.
#pragma once

#include <cstdint>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lab/peers_testbed/scenario.h"

namespace interneuron::peers_testbed {

// What a run comes to: a row of figures for each deadline by which it is judged.
struct Row {
  const Scenario* scenario = nullptr;
  const Peer* peer = nullptr;
  std::size_t message_bytes = 0;
  Duration period{};
  Duration deadline{};
  std::uint64_t seed = 0;
  std::size_t messages = 0;
  // Without any variant by the deadline.
  std::size_t missed = 0;
  // On time, but in a smaller variant.
  std::size_t degraded = 0;
  // IP bytes that left the vehicle by its modems, over the bytes of the whole messages.
  double wire_ratio = 0;
  // From handing over to arrival, of all messages: the age that half of them, 99 % of them had at
  // most. Nothing: as many never came. A peer may not deliver what is late.
  std::optional<double> p50_ms{};
  std::optional<double> p99_ms{};
  // Processor time of the sending program and of the receiving one, for each message.
  double cpu_us_send = 0;
  // Nothing: fewer than two messages came.
  std::optional<double> cpu_us_receive{};
  // Which messages those without any variant were, counted from 0, in order.
  std::vector<std::size_t> missed_numbers{};
  // By how much the emulator was late with a packet at most: a message may be missed for that.
  double emulator_late_ms = 0;
};

// One row for each deadline of the run. Pure; thread-safe; no errors: arrivals of messages that
// were never handed over are left out.
std::vector<Row> rows_of(const Run& run, const transports::VehiclesRecord& vehicle,
                         const transports::RoadRecord& road);

transports::Transport transport_of(const Run& run);

struct Ran {
  std::vector<Row> rows;
  // What makes the figures doubtful, one line; empty: nothing was seen.
  std::string doubt;
};

// One run of the comparison on real sockets.
//
// A testbed is made for it: a host with the vehicle, one with the roadside unit, between them two
// modems with a link of the emulator each. Real time and a shared machine: figures differ from run
// to run; what the links do does not, but for the instants at which packets meet it.
//
// Errors: netns::TestbedError where namespaces are forbidden (5 or 77, as those commands have
// them); Failure when a program fails or a signal comes, for which a SignalWatch must be alive.
// Whatever way it ends, programs, namespaces and the files in `scratch` are gone.
// Thread-compatible. `scratch` is a folder for the run's files, private to it; it is made if it is
// not there.
Ran play_run(const Run& run, const std::filesystem::path& scratch);

// How long a run takes, about.
Duration time_of_run(const Run& run);

// A peer that this machine cannot run, and why, one line that does not name it.
struct Skipped {
  std::string peer;
  std::string reason;
};

struct Compared {
  std::vector<Row> rows;
  std::vector<Skipped> skipped;
  // What ended the series before its last run, a signal mostly: rows are those of the runs before.
  std::exception_ptr ended;
};

// All runs of `bench peers`, one after the other: what this machine can. Tells on stderr which
// peers are left out and why, how far it is, and what makes a row doubtful. A SignalWatch must be
// alive. Throws Failure (77) when nothing is left, and what the first play_run() throws.
Compared compare(const std::vector<Run>& runs);

// The runs of `bench peers --quick`: what there is to see in less than 25 minutes.
//
// Everything that is compared takes hours. Here the peers meet in messages of 128 KiB with a
// deadline of 100 ms under one condition after the other; what becomes of other sizes and deadlines
// is shown for a few of them, with losses. Pure; thread-safe; no errors. By scenario, then by size,
// then by peer, then by deadline.
std::vector<Run> quick_runs(std::uint64_t seed);

// The rows of `bench peers` as tables for a page: a line for each peer, a column for each
// condition, as Markdown. Pure; thread-safe; no errors. Conditions under which the same peers were
// run share a table. A cell has the messages that were missed, in brackets those in a smaller
// variant, and the bytes sent per byte. Processor time is of the first condition of a table.
std::string page_of(const std::vector<Row>& rows);

}  // namespace interneuron::peers_testbed
