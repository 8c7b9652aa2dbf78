#include "lab/bench/command.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "app/process/failure.h"
#include "app/process/progress.h"
#include "app/process/signals.h"
#include "app/settings/link_options.h"
#include "lab/bench/reports.h"
#include "lab/load/run.h"
#include "lab/load_testbed/run.h"
#include "lab/transports/programs.h"

namespace interneuron::bench {
namespace {

// Offered loads, seconds: wide, they catch slips of pen.
constexpr double kLeastLoad = 0.01;
constexpr double kMostLoad = 20;
constexpr double kLeastSeconds = 1;
constexpr double kMostSeconds = 3600;

struct LoadOptions {
  std::vector<std::string> groups;
  std::vector<std::string> peers;
  std::vector<double> loads;
  double seconds = 20;
  std::uint64_t seed = 1;
  bool testbed = false;
  bool clear = false;
  bool together = false;
  std::string cross = "cubic";
  std::string transport = "auto";
  bool json = false;
  std::string plot;
};

std::vector<std::string> group_names() {
  std::vector<std::string> out;
  for (const load::Group& group : load::groups()) out.emplace_back(group.name);
  return out;
}

bool takes_loads(const std::string& name) {
  return std::ranges::any_of(load::groups(),
                             [&](const load::Group& g) { return g.name == name && g.takes_loads; });
}

std::string names_of(std::span<const load::Peer> peers) {
  std::string out;
  for (const load::Peer peer : peers) {
    out += (out.empty() ? "" : ", ") + std::string(load::name_of(peer));
  }
  return out;
}

std::vector<load::Scenario> chosen(const LoadOptions& o) {
  load::Choice choice;
  const std::span<const load::Peer> able = o.testbed ? load::real_peers() : load::modelled_peers();
  for (const std::string& name : o.peers) {
    choice.peers.push_back(*load::peer_of(name));
    if (std::ranges::find(able, choice.peers.back()) != able.end()) continue;
    throw process::Failure(process::kUsage,
                           fmt::format("--peer {}: {}; there are {}", name,
                                       o.testbed ? "a model, for virtual time alone"
                                                 : "the kernel's own, with --testbed alone",
                                       names_of(able)));
  }
  if (choice.peers.empty()) choice.peers.assign(able.begin(), able.end());
  choice.loads = o.loads;
  if (o.testbed && o.loads.empty()) {
    choice.loads.assign(std::begin(load_testbed::kTestbedLoads),
                        std::end(load_testbed::kTestbedLoads));
  }
  choice.length = from_ms(o.seconds * 1000);
  choice.seed = o.seed;
  choice.is_encrypted = !o.clear;
  choice.is_spread = !o.together;
  choice.is_cross_bbr = o.cross == "bbr";
  std::vector<std::string> names = o.groups.empty() ? group_names() : o.groups;
  if (!o.loads.empty()) {
    // Groups that are named and have loads of their own are a mistake, others are left out.
    for (const std::string& name : o.groups) {
      if (takes_loads(name)) continue;
      throw process::Failure(process::kUsage,
                             "--load: the group " + name + " has loads of its own; leave it out");
    }
    std::erase_if(names, [](const std::string& name) { return !takes_loads(name); });
  }
  std::vector<load::Scenario> out;
  for (const std::string& name : names) {
    for (load::Scenario& s : load::scenarios(name, choice)) out.push_back(std::move(s));
  }
  return out;
}

std::vector<load::Row> run_in_virtual_time(const std::vector<load::Scenario>& scenarios) {
  std::vector<load::Row> rows(scenarios.size());
  process::Progress progress;
  progress.for_each("bench load", scenarios.size(),
                    [&](std::size_t i) { rows[i] = load::run(scenarios[i]); });
  return rows;
}

int run_load(const LoadOptions& o) {
  const std::vector<load::Scenario> scenarios = chosen(o);
  const bool drawable = std::ranges::any_of(
      scenarios, [](const load::Scenario& s) { return s.group == "rate" || s.group == "size"; });
  require_picture(o.plot);
  if (!o.plot.empty() && !drawable) {
    throw process::Failure(process::kUsage,
                           "--plot: only the groups rate and size are drawn; name one of them");
  }
  const process::SignalWatch signals;
  const TransportKind datagrams = settings::transport_kind(o.transport);
  const std::vector<load::Row> rows =
      o.testbed ? load_testbed::run_series(scenarios, datagrams) : run_in_virtual_time(scenarios);
  if (o.json) {
    fmt::print("{}\n",
               load_json(rows, o.testbed ? std::optional(datagrams) : std::nullopt).dump(2));
  } else {
    print_load(rows);
  }
  if (!o.plot.empty()) plot_load(o.plot, rows);
  if (!o.plot.empty() && !o.json) fmt::print("\nwritten to {}\n", o.plot);
  return process::kFine;
}

void add_load(CLI::App& bench, std::function<int()>& run) {
  auto o = std::make_shared<LoadOptions>();
  CLI::App* c =
      bench.add_subcommand("load", "On-time goodput against offered load through one bottleneck");
  c->add_option("GROUP", o->groups, "What is run (default: everything)")
      ->check(CLI::IsMember(group_names()));
  std::vector<std::string> peers(load::peer_names().begin(), load::peer_names().end());
  c->add_option("--peer", o->peers,
                "A transport; once per transport, or with commas (default: all)")
      ->delimiter(',')
      ->take_all()
      ->allow_extra_args(false)
      ->check(CLI::IsMember(peers));
  c->add_option("--load", o->loads,
                "Offered load, IP bytes over the bottleneck's rate; once per load, or with commas "
                "(default: the group's; with --testbed 1.05 and 1.5)")
      ->delimiter(',')
      ->take_all()
      ->allow_extra_args(false)
      ->check(CLI::Range(kLeastLoad, kMostLoad));
  c->add_option("--seed", o->seed, "Seed of the vehicles' phases and of the links")
      ->capture_default_str();
  CLI::Option* testbed =
      c->add_flag("--testbed", o->testbed,
                  "On real sockets and emulated links instead of in virtual time, with the "
                  "kernel's TCP and MPTCP (docs/load.md)");
  CLI::Option* clear =
      c->add_flag("--clear", o->clear,
                  "In virtual time: our own endpoints have no keys, unlike `vehicle` and `road`")
          ->excludes(testbed);
  // What is the default now was an option once, and is accepted still.
  c->add_flag("--encrypted")->group("")->excludes(clear);
  c->add_flag("--together", o->together,
              fmt::format("All vehicles join at one instant instead of up to {} ms apart",
                          load::kMostApart / std::chrono::milliseconds(1)));
  c->add_option("--cross", o->cross,
                "What controls the flow beside ours in the group cubic: a model, or with --testbed "
                "the kernel's")
      ->capture_default_str()
      ->check(CLI::IsMember({"cubic", "bbr"}));
  settings::add_transport_option(*c, o->transport)->needs(testbed);
  c->add_option("--seconds,--duration", o->seconds, "How long messages begin")
      ->capture_default_str()
      ->check(CLI::Range(kLeastSeconds, kMostSeconds));
  c->add_flag("--json", o->json, "The rows as JSON on stdout (docs/schema/load.json)");
  c->add_option("--plot", o->plot, "Draws rate and size into this file, .svg or .png");
  std::string footer = "Groups:\n";
  for (const load::Group& g : load::groups()) {
    footer += fmt::format("  {:10} {}\n", g.name, g.about);
  }
  c->footer(footer +
            "Examples:\n  interneuron bench load\n  interneuron bench load rate --peer ours "
            "--load 1.05,1.5\n"
            "  interneuron bench load rate --testbed --peer ours,tcp_cubic\n"
            "  interneuron bench load rate size --plot load.svg");
  c->callback([&run, o] { run = [o] { return run_load(*o); }; });
}

// What runs on a testbed start in its hosts. An empty group hides it from the help.
void add_play(CLI::App& bench, std::function<int()>& run) {
  struct Play {
    std::string order;
    std::string end;
  };
  auto o = std::make_shared<Play>();
  CLI::App* c = bench.add_subcommand("play", "One end of a run")->group("");
  c->add_option("--order", o->order, "What is played")->required();
  c->add_option("--end", o->end, "Which end this is")
      ->required()
      ->check(CLI::IsMember({transports::kVehiclesEnd, transports::kRoadEnd, transports::kCrossEnd,
                             transports::kCrossRoadEnd}));
  c->callback([&run, o] { run = [o] { return transports::play_end(o->order, o->end); }; });
}

}  // namespace

void add_bench(CLI::App& program, std::function<int()>& run) {
  CLI::App* bench = program.add_subcommand("bench", "Measures Interneuron beside other transports");
  bench->require_subcommand(1);
  add_load(*bench, run);
  add_forecast(*bench, run);
  add_coding(*bench, run);
  add_drives(*bench, run);
  add_peers(*bench, run);
  add_transports(*bench, run);
  add_play(*bench, run);
}

}  // namespace interneuron::bench
