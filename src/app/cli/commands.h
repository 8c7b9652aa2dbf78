// The commands of the program `interneuron`. Each function adds one; when the arguments name it,
// parsing sets `run` to what is to be done, which returns the exit code.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// `doctor`: is this host set up for several network cards (NICs) at once? Changes nothing.
void add_doctor(CLI::App& program, std::function<int()>& run);

// `keys`: makes keys, and tells public ones.
void add_keys(CLI::App& program, std::function<int()>& run);

// The part of `keys` that is for a fleet authority: signs the keys of vehicles, looks at what was
// signed, and takes keys back.
void add_fleet_keys(CLI::App& keys, std::function<int()>& run);

// `links`: the network cards (NICs) of this host, what the kernel says of each and what was
// measured on it.
void add_links(CLI::App& program, std::function<int()>& run);

// `probe`: pings and trains to a roadside unit or any STAMP reflector, over every NIC at once.
void add_probe(CLI::App& program, std::function<int()>& run);

// `top`: the links of this host, live.
void add_top(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
