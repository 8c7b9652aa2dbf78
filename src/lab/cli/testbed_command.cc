#include "lab/cli/testbed_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <variant>

#include "app/process/failure.h"
#include "app/records/json_file.h"
#include "lab/cli/commands.h"
#include "lab/emu/link_change.h"
#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/scenario.h"
#include "netns/state/snapshot.h"
#include "netns/state/state.h"
#include "netns/testbed/backend_option.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::cli {
namespace {

using netns::Testbed;
using records::Json;

constexpr double kMaxSeconds = 86'400;

struct TestbedOptions {
  std::string name = "default";
  std::optional<std::uint64_t> seed;
  std::vector<std::string> links;
  std::string scenario;
  std::size_t vehicles = 1;
  std::size_t roads = 1;
  netns::Backend backend = netns::Backend::kAuto;
  bool nat = false;
  std::string host = "vehicle";
  std::vector<std::string> command;
  std::string link;
  std::vector<std::string> settings;
  std::string event;
  double seconds = 60;
  std::string plot;
  bool json = false;
};

emu::Scenario scenario(const TestbedOptions& o) {
  if (!o.scenario.empty() && !o.links.empty()) {
    throw process::Failure(process::kUsage,
                           "--scenario names the links itself; leave out --profile");
  }
  if (!o.scenario.empty()) return netns::load_scenario(o.scenario, o.seed);
  constexpr std::uint64_t kDefaultSeed = 1;
  const std::uint64_t seed = o.seed.value_or(kDefaultSeed);
  return o.links.empty() ? netns::default_scenario(seed) : netns::scenario_of(o.links, seed);
}

int up(const TestbedOptions& o) {
  netns::TestbedOptions options{.name = o.name,
                                .scenario = scenario(o),
                                .vehicles = o.vehicles,
                                .roads = o.roads,
                                .backend = o.backend,
                                .nat = o.nat,
                                .detached = true};
  const Testbed testbed = Testbed::up(options);
  const netns::State& state = testbed.state();
  fmt::print("testbed '{}' is up: {}, seed {}, holder {}\n", state.name,
             netns::backend_name(state.backend), state.seed, state.holder);
  const std::size_t shown = std::min<std::size_t>(state.links.size(), 8);
  for (std::size_t i = 0; i < shown; ++i) {
    const netns::TestbedLink& link = state.links[i];
    fmt::print("  {:<10} {:<12} {:<14} {:<14} -> road {:<14} {}\n",
               netns::host_name({netns::Host::Kind::kVehicle, link.vehicle}), link.nic,
               link.profile, link.vehicle_address, link.road_address, link.road_address6);
  }
  if (shown < state.links.size()) {
    fmt::print("  ... and {} more; `interneuron testbed status --name {}` shows all\n",
               state.links.size() - shown, state.name);
  }
  fmt::print("try: interneuron testbed run --name {} -- ping -c 3 -I {} {}\n", state.name,
             state.links.front().nic, state.links.front().road_address);
  return process::kFine;
}

Json direction_json(const emu::DirectionStats& d) {
  return {{"packets", d.packets_in},
          {"delivered", d.delivered},
          {"lost", d.lost},
          {"queue_drops", d.queue_drops},
          {"outage_lost", d.outage_lost},
          {"duplicated", d.duplicated},
          {"corrupted", d.corrupted},
          {"reordered", d.reordered},
          {"too_big", d.too_big},
          {"nat_drops", d.nat_drops},
          {"policed", d.policed},
          {"bytes", d.bytes_in},
          {"bytes_delivered", d.bytes_delivered}};
}

// No radio: nothing gets through in either direction.
bool is_outage(const netns::ScheduleSample& sample) {
  return sample.loss_up >= 1 && sample.loss_down >= 1;
}

// What the link is like now, from the newest step of its schedule.
std::optional<netns::ScheduleSample> latest(const netns::State& state, const netns::Snapshot& s,
                                            std::size_t index) {
  if (!s.epoch) return std::nullopt;
  const Duration time = io::now() - *s.epoch;
  const auto samples = Testbed::schedule(state, index, time - std::chrono::seconds(1), time);
  if (samples.empty()) return std::nullopt;
  return samples.back();
}

Json status_json(const netns::State& state, const netns::Snapshot& s) {
  Json json{{"schema", "interneuron.testbed/2"},
            {"name", state.name},
            {"holder_pid", state.holder},
            {"backend", netns::backend_name(state.backend)},
            {"seed", state.seed},
            {"nat", state.nat},
            {"vehicles", state.vehicle_count()},
            {"roads", state.road_ns_fds.size()},
            {"started", s.epoch.has_value()},
            {"lateness_mean_us", s.lateness_mean_us},
            {"lateness_max_us", s.lateness_max_us},
            {"kernel_drops", s.kernel_drops},
            {"netem_steps_skipped", s.netem_skipped},
            {"netem_nics_put_off", s.netem_put_off},
            {"netem_requests_failed", s.netem_failed}};
  if (s.epoch) json["epoch_monotonic_ns"] = s.epoch->time_since_epoch().count();
  for (std::size_t i = 0; i < s.links.size(); ++i) {
    const netns::TestbedLink& link = state.links[i];
    Json item{{"name", link.name},
              {"vehicle", netns::host_name({netns::Host::Kind::kVehicle, link.vehicle})},
              {"profile", link.profile},
              {"nic", link.nic},
              {"vehicle_address", link.vehicle_address},
              {"gateway", link.gateway},
              {"road_address", link.road_address},
              {"vehicle_address6", link.vehicle_address6},
              {"road_address6", link.road_address6},
              {"up", direction_json(s.links[i].up)},
              {"down", direction_json(s.links[i].down)}};
    if (const auto now = latest(state, s, i)) {
      item["now"] = {{"outage", is_outage(*now)},
                     {"rtt_ms", is_outage(*now) ? Json(nullptr) : Json(to_ms(now->rtt))},
                     {"loss_up", now->loss_up},
                     {"loss_down", now->loss_down},
                     {"rate_up_mbit", now->rate_up.mbit()},
                     {"rate_down_mbit", now->rate_down.mbit()}};
    }
    json["links"].push_back(std::move(item));
  }
  return json;
}

std::string rtt_text(const std::optional<netns::ScheduleSample>& now) {
  if (!now) return "-";
  return is_outage(*now) ? "outage" : fmt::format("{:.1f} ms", to_ms(now->rtt));
}

int status(const TestbedOptions& o) {
  const netns::State state = found_testbed(o.name);
  const netns::Snapshot s = Testbed::snapshot(state);
  if (o.json) {
    fmt::print("{}\n", status_json(state, s).dump(2));
    return process::kFine;
  }
  fmt::print("testbed '{}': {}, {} vehicle(s), {} roadside unit(s){}, seed {}, holder {}, {}\n",
             state.name, netns::backend_name(state.backend), state.vehicle_count(),
             state.road_ns_fds.size(), state.nat ? ", NAT" : "", state.seed, state.holder,
             s.epoch ? "running" : "waiting for the first packet");
  fmt::print("{:<24}{:>10}{:>12}{:>12}{:>10}{:>12}{:>10}\n", "link", "rtt now", "packets",
             "delivered", "lost", "queue drops", "other");
  for (std::size_t i = 0; i < s.links.size(); ++i) {
    const auto now = latest(state, s, i);
    const std::string label =
        (state.vehicle_count() > 1
             ? netns::host_name({netns::Host::Kind::kVehicle, s.links[i].vehicle}) + "/"
             : "") +
        s.links[i].name;
    for (const auto& [name, d] :
         {std::pair{"up", &s.links[i].up}, std::pair{"down", &s.links[i].down}}) {
      fmt::print("{:<24}{:>10}{:>12}{:>12}{:>10}{:>12}{:>10}\n", label + " " + name, rtt_text(now),
                 d->packets_in, d->delivered, d->lost, d->queue_drops,
                 d->outage_lost + d->too_big + d->nat_drops + d->policed);
    }
  }
  return process::kFine;
}

int list() {
  // Before anything is printed: it may be refused.
  const auto testbeds = Testbed::list();
  fmt::print("profiles:\n");
  for (const emu::BuiltInProfile& built_in : emu::built_in_profiles()) {
    const auto profile = emu::built_in_profile(built_in.name);
    fmt::print("  {:<24} {}\n", built_in.name, profile ? profile->description : "");
  }
  fmt::print("{}\n", testbeds.empty() ? "no testbed is up" : "testbeds that are up:");
  for (const netns::State& state : testbeds) {
    std::string links;
    for (std::size_t i = 0; i < state.network_count(); ++i) {
      links += (i > 0 ? ", " : "") + state.links[i].name;
    }
    fmt::print("  {:<24} {}, {} vehicle(s) with {}\n", state.name,
               netns::backend_name(state.backend), state.vehicle_count(), links);
  }
  return process::kFine;
}

int event(const TestbedOptions& o) {
  if (!(o.seconds > 0)) throw process::Failure(process::kUsage, "an outage lasts more than 0 s");
  Testbed::outage(found_testbed(o.name), o.link, from_ms(o.seconds * 1e3));
  fmt::print("{}: no radio for {:g} s\n", o.link, o.seconds);
  return process::kFine;
}

// Found out here and not by the testbed, which cannot tell who named what: keys and values are on
// our command line, but for those of a profile's file.
void check_settings(const std::vector<std::string>& settings) {
  constexpr std::string_view kProfile = "profile=";
  for (const std::string& setting : settings) {
    const auto parsed = emu::parse_change(std::span(&setting, 1), netns::profile_resolver("."));
    const auto* error = std::get_if<emu::ProfileError>(&parsed);
    if (error == nullptr) continue;
    const bool file =
        setting.starts_with(kProfile) && netns::is_profile_file(setting.substr(kProfile.size()));
    throw process::Failure(file ? process::kConfiguration : process::kUsage, error->what);
  }
}

int set(const TestbedOptions& o) {
  check_settings(o.settings);
  Testbed::change(found_testbed(o.name), o.link, o.settings);
  fmt::print("{}: {}\n", o.link, fmt::join(o.settings, " "));
  return process::kFine;
}

// "5s", "500ms", "2min"; in seconds.
CLI::Validator duration_in_seconds() {
  return CLI::AsNumberWithUnit(std::map<std::string, double>{{"ms", 1e-3}, {"s", 1}, {"min", 60}},
                               CLI::AsNumberWithUnit::CASE_INSENSITIVE, "TIME");
}

void add_link_options(CLI::App& sub, const std::shared_ptr<TestbedOptions>& o) {
  sub.add_option("--profile,--link", o->links,
                 "Links by comma: a profile (`testbed list` names them) or TOML file each, or "
                 "NAME=either; default 5g,4g")
      ->delimiter(',')
      ->take_all();
  sub.add_option("--scenario", o->scenario,
                 "TOML file with links, how they fade together, and events; see "
                 "docs/testbed.md");
  sub.add_option("--seed", o->seed, "Seed of the links' processes (default 1, or the scenario's)");
}

void add_up(CLI::App& sub, const std::shared_ptr<TestbedOptions>& o) {
  add_link_options(sub, o);
  sub.add_option("--vehicles", o->vehicles, "How many, each with all links")
      ->capture_default_str()
      ->check(CLI::Range(std::size_t{1}, netns::kMaxVehicles));
  sub.add_option("--roads", o->roads, "How many roadside units")
      ->capture_default_str()
      ->check(CLI::Range(std::size_t{1}, netns::kMaxRoads));
  add_backend_option(sub, o->backend);
  sub.add_flag("--nat", o->nat, "Translate the vehicles' addresses as a carrier's gateway does");
}

void add_schedule(CLI::App& testbed, const std::shared_ptr<TestbedOptions>& o,
                  std::function<int()>& run) {
  CLI::App* plan = testbed.add_subcommand(
      "schedule", "What the model prescribes, as CSV of 100 rows a second; needs no testbed");
  plan->callback([&run, o] {
    run = [o] { return print_schedule(scenario(*o), from_ms(o->seconds * 1e3), o->plot); };
  });
  add_link_options(*plan, o);
  plan->add_option("--seconds", o->seconds, "How long")
      ->capture_default_str()
      ->check(CLI::Range(0.01, kMaxSeconds));
  plan->add_option("--plot", o->plot, "Draw it into this file instead, FILE.png or FILE.svg");
}

}  // namespace

void add_testbed(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<TestbedOptions>();
  CLI::App* testbed = program.add_subcommand(
      "testbed", "Vehicles and roadside units on this machine, joined by emulated modems");
  testbed->require_subcommand(1);
  testbed->footer(
      "Examples:\n"
      "  interneuron testbed up --seed 7 --profile a=5g,b=4g\n"
      "  interneuron testbed run --in vehicle -- ping -c 5 -I ifa 10.77.0.1\n"
      "  interneuron testbed set a rtt_ms=80 up.loss=0.02\n"
      "  interneuron testbed event b outage 5s\n"
      "  interneuron testbed verify\n"
      "  interneuron testbed down");
  const auto add = [&](const char* name, const char* text, int (*body)(const TestbedOptions&)) {
    CLI::App* sub = testbed->add_subcommand(name, text);
    sub->add_option("--name", o->name, "Name of the testbed; several may be up")
        ->capture_default_str();
    sub->callback([&run, o, body] { run = [o, body] { return body(*o); }; });
    return sub;
  };
  add_up(*add("up", "Make it and leave it running", up), o);

  CLI::App* in =
      add("run", "Run a program inside it; returns its exit code", [](const TestbedOptions& a) {
        return Testbed::run_in(found_testbed(a.name), netns::parse_host(a.host), a.command);
      });
  in->add_option("--in", o->host, "vehicle, vehicle2, ..., road, road2, ..., core")
      ->capture_default_str();
  in->add_option("command", o->command, "Program and arguments, after --")->required();

  add("status", "Its links: what they are like now, what they have carried", status)
      ->add_flag("--json", o->json, "As JSON");

  std::string keys;
  for (const std::string_view key : emu::change_keys()) keys += " " + std::string(key);
  CLI::App* setting = add("set", "Change a link while it runs, from now on", set);
  setting->add_option("link", o->link, "5g, vehicle2/5g, or * for all")->required();
  setting->add_option("settings", o->settings, "KEY=VALUE, also up.KEY, down.KEY:" + keys)
      ->required();

  CLI::App* happening = add("event", "Make something happen to a link now", event);
  happening->add_option("link", o->link, "5g, vehicle2/5g, or * for all")->required();
  happening->add_option("event", o->event, "outage")->required()->check(CLI::IsMember({"outage"}));
  happening->add_option("duration", o->seconds, "5s, 500ms, 2min")
      ->required()
      ->transform(duration_in_seconds());

  add("down", "End it; nothing is left", [](const TestbedOptions& a) {
    Testbed::down(found_testbed(a.name));
    fmt::print("testbed '{}' is down\n", a.name);
    return process::kFine;
  });

  CLI::App* all = testbed->add_subcommand("list", "The profiles, and the testbeds that are up");
  all->callback([&run] { run = list; });
  add_schedule(*testbed, o, run);
  add_testbed_verify(*testbed, run);
}

}  // namespace interneuron::cli
