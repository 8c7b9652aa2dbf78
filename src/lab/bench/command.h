// The commands of `interneuron bench`. add_NAME() adds one; when the arguments name it, parsing
// sets `run` to what is to be done, which returns the exit code and throws Failure.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::bench {

// The command itself with all that follow, and `interneuron bench load`: on-time goodput against
// offered load, ours beside other transports, in virtual time or on the testbed.
void add_bench(CLI::App& program, std::function<int()>& run);

// `interneuron bench coding`: what symbols, shares and shadows save, and what they cost in bytes,
// as a table or JSON (docs/schema/coding.json).
void add_coding(CLI::App& bench, std::function<int()>& run);

// `interneuron bench drives`: what is missed while the rates of two modems change, beside each of
// them alone and a clairvoyant, as a table or JSON (docs/schema/drives.json).
void add_drives(CLI::App& bench, std::function<int()>& run);

// `interneuron bench forecast`: whether the chances that send() predicts are kept, in virtual time.
void add_forecast(CLI::App& bench, std::function<int()>& run);

// `interneuron bench peers`: Interneuron beside other transports over two emulated modems.
void add_peers(CLI::App& bench, std::function<int()>& run);

// `interneuron bench transports`: what the transports of a NIC cost, as a table or JSON
// (docs/schema/transports.json).
void add_transports(CLI::App& bench, std::function<int()>& run);

}  // namespace interneuron::bench
