#include "cli/testbed_command.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "cli/failure.h"
#include "netns/testbed.h"

namespace interneuron::cli {
namespace {

using netns::Testbed;

struct Options {
  std::string name = "default";
  std::uint64_t seed = 1;
  std::vector<std::string> links;
  std::string side = "vehicle";
  std::vector<std::string> command;
  bool json = false;
};

netns::State found(const std::string& name) {
  auto state = Testbed::find(name);
  if (!state) {
    throw Failure(kFailed, "testbed '" + name + "' is not up; `interneuron testbed up --name " +
                               name + "` makes it");
  }
  return *state;
}

int up(const Options& o) {
  netns::TestbedOptions options;
  options.name = o.name;
  options.seed = o.seed;
  options.detached = true;
  if (!o.links.empty()) {
    options.links.clear();
    for (const std::string& link : o.links) options.links.push_back(netns::load_link(link));
  }
  const Testbed testbed = Testbed::up(options);
  fmt::print("testbed '{}' is up (seed {}, holder {})\n", o.name, o.seed, testbed.state().holder);
  for (const netns::TestbedLink& link : testbed.state().links) {
    fmt::print("  {}: vehicle {} {}, road {} {}\n", link.profile, link.nic, link.vehicle_address,
               link.nic, link.road_address);
  }
  fmt::print("try: interneuron testbed run --in vehicle --name {} -- ping -c 3 {}\n", o.name,
             testbed.state().links.front().road_address);
  return kFine;
}

int status(const Options& o) {
  const netns::State state = found(o.name);
  const netns::Snapshot s = Testbed::snapshot(state);
  nlohmann::ordered_json json{
      {"schema", "interneuron.testbed/1"},    {"name", state.name},
      {"holder_pid", state.holder},           {"seed", state.seed},
      {"started", s.epoch.has_value()},       {"lateness_mean_us", s.lateness_mean_us},
      {"lateness_max_us", s.lateness_max_us}, {"kernel_drops", s.kernel_drops}};
  const auto direction = [](const emu::DirectionStats& d) {
    return nlohmann::ordered_json{{"packets", d.packets_in},
                                  {"delivered", d.delivered},
                                  {"lost", d.lost},
                                  {"queue_drops", d.queue_drops},
                                  {"bytes", d.bytes_in}};
  };
  for (std::size_t i = 0; i < s.links.size(); ++i) {
    json["links"].push_back({{"name", s.links[i].name},
                             {"profile", state.links[i].profile},
                             {"nic", state.links[i].nic},
                             {"up", direction(s.links[i].up)},
                             {"down", direction(s.links[i].down)}});
  }
  if (o.json) {
    fmt::print("{}\n", json.dump(2));
    return kFine;
  }
  fmt::print("testbed '{}': holder {}, seed {}, {}\n", state.name, state.holder, state.seed,
             s.epoch ? "running" : "waiting for the first packet");
  fmt::print("{:<16}{:>12}{:>12}{:>10}{:>12}\n", "link", "packets", "delivered", "lost",
             "queue drops");
  for (const netns::LinkSnapshot& link : s.links) {
    for (const auto& [name, d] : {std::pair{"up", &link.up}, std::pair{"down", &link.down}}) {
      fmt::print("{:<16}{:>12}{:>12}{:>10}{:>12}\n", link.name + " " + name, d->packets_in,
                 d->delivered, d->lost, d->queue_drops);
    }
  }
  return kFine;
}

}  // namespace

void add_testbed(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<Options>();
  CLI::App* testbed =
      program.add_subcommand("testbed", "Two network namespaces joined by emulated modems");
  testbed->require_subcommand(1);
  testbed->footer(
      "Examples:\n"
      "  interneuron testbed up --seed 7 --link 5g --link 4g\n"
      "  interneuron testbed run --in vehicle -- ping -c 5 10.77.1.2\n"
      "  interneuron testbed down");
  const auto add = [&](const char* name, const char* text) {
    CLI::App* sub = testbed->add_subcommand(name, text);
    sub->add_option("--name", o->name, "Name of the testbed; several may be up")
        ->capture_default_str();
    return sub;
  };
  CLI::App* up_command = add("up", "Make it and leave it running");
  up_command->add_option("--seed", o->seed, "Seed of the links' delay processes")
      ->capture_default_str();
  up_command
      ->add_option("--link", o->links,
                   "Profile (5g, 4g, clean), TOML file, or NAME=either; once per link")
      ->take_all();
  up_command->callback([&run, o] { run = [o] { return up(*o); }; });
  CLI::App* run_command = add("run", "Run a program inside it; returns its exit code");
  run_command->add_option("--in", o->side, "vehicle or road")
      ->capture_default_str()
      ->check(CLI::IsMember({"vehicle", "road"}));
  run_command->add_option("command", o->command, "Program and arguments, after --")->required();
  run_command->callback([&run, o] {
    run = [o] {
      const auto side = o->side == "road" ? netns::Side::kRoad : netns::Side::kVehicle;
      return Testbed::run_in(found(o->name), side, o->command);
    };
  });
  CLI::App* down_command = add("down", "End it; nothing is left");
  down_command->callback([&run, o] {
    run = [o] {
      Testbed::down(found(o->name));
      fmt::print("testbed '{}' is down\n", o->name);
      return kFine;
    };
  });
  CLI::App* status_command = add("status", "What its links have carried");
  status_command->add_flag("--json", o->json, "As JSON");
  status_command->callback([&run, o] { run = [o] { return status(*o); }; });
}

}  // namespace interneuron::cli
