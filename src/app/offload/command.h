// The commands `vehicle` and `road`, and the options that they share with what starts them.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/offload/hooks.h"

namespace interneuron::offload {

// Makes the hooks of a run when it begins; null for a plain run.
template <class Hooks>
using MakeHooks = std::function<std::unique_ptr<Hooks>()>;

// Add the commands, which are returned for further options. When the arguments name one, parsing
// sets `run` to what is to be done. `make_hooks` may be empty.
CLI::App* add_vehicle(CLI::App& program, std::function<int()>& run,
                      MakeHooks<VehicleHooks> make_hooks = {});
CLI::App* add_road(CLI::App& program, std::function<int()>& run,
                   MakeHooks<RoadHooks> make_hooks = {});

void add_images_option(CLI::App* c, std::string& images);
void add_deadline_options(CLI::App* c, double& deadline_ms, std::string& guard, std::string& policy,
                          double& objective);
// `more_ladders` are allowed beside those that detect.
void add_input_options(CLI::App* c, std::string& video, std::string& data, std::string& ladder,
                       const std::vector<std::string>& more_ladders = {});
void add_calibration_option(CLI::App* c, int& runs);

}  // namespace interneuron::offload
