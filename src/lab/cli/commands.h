// The commands of `interneuron-lab`. add_NAME() adds one; when the arguments name it, parsing sets
// `run` to what is to be done, which returns the exit code and throws Failure.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// `interneuron demo`: a vehicle and a roadside unit in two network namespaces, joined by emulated
// modems.
void add_demo(CLI::App& program, std::function<int()>& run);

// `interneuron testbed up | run | status | set | event | verify | down | list | schedule`: emulated
// modems for any program.
void add_testbed(CLI::App& program, std::function<int()>& run);

// `interneuron eval EXPERIMENT`: the paper's experiments and more, in virtual time.
void add_eval(CLI::App& program, std::function<int()>& run);

// `interneuron report DIR`: a page of what `interneuron eval` has left in a folder.
void add_report(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
