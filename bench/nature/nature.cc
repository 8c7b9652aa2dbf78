// The program `nature_bench`: measures how soon the estimates and scores of a link follow steps of
// its delay, loss and rate, on a testbed of its own, without load and under load.
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>

#include "app/process/child.h"
#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/records/run_files.h"
#include "bench/nature/nature_nodes.h"
#include "bench/nature/nature_plot.h"
#include "netns/state/error.h"
#include "netns/testbed/backend_option.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::bench {
namespace {

namespace fs = std::filesystem;
using netns::Testbed;
using process::Child;
using process::Failure;
using process::kFailed;
using process::kFine;
using process::kUsage;
using process::SignalWatch;

constexpr const char* kTested = "tested";
constexpr const char* kOther = "reference";
constexpr std::size_t kTestedLink = 0;
// How long is waited after the outage for the path to be used again. A link that is back must be
// used within a second; twice that shows by how much the bound is missed, if it is.
constexpr Duration kAfterOutage = std::chrono::seconds(2);

struct Options {
  std::string load = "both";
  double phase_s = 12;
  std::string out = "out/nature";
  netns::Backend backend = netns::Backend::kAuto;
  bool json = false;
  // A capture file of the vehicle's packets; empty: none.
  std::string pcap;
};

// Throws when the node has ended by itself; the node has then written the reason to stderr.
void must_live(process::Child& node) {
  if (node.ended()) throw process::Failure(process::kFailed, "a node ended early");
}

// The conditions as Testbed::change() takes them.
std::vector<std::string> settings(const Conditions& c) {
  return {fmt::format("rtt_ms={}", c.rtt_ms), fmt::format("loss={}", c.loss),
          fmt::format("rate_mbit={}", c.rate_mbit)};
}

// Joins the lines of both links at one instant to one Belief: the vehicle writes the tested link's
// first.
std::vector<Belief> beliefs_of(const std::vector<Line>& lines, TimePoint start) {
  std::vector<Belief> out;
  for (const Line& line : lines) {
    if (line.at < start) continue;
    if (line.link == kTestedLink) {
      out.push_back({line.at - start, line.rtt_ms, line.loss, line.rate_mbit, line.nature, {}});
    } else if (!out.empty()) {
      out.back().reference = line.nature;
    }
  }
  return out;
}

// Fills `run.convergence` from the beliefs of each phase.
void judge(Run& run) {
  const auto all = steps();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Duration end = i + 1 < run.began.size() ? run.began[i + 1] : run.end;
    const auto before = [](const Belief& b, Duration t) { return b.at < t; };
    const auto first =
        std::lower_bound(run.beliefs.begin(), run.beliefs.end(), run.began[i], before);
    const auto last = std::lower_bound(first, run.beliefs.end(), end, before);
    run.convergence.push_back(converge(all[i], run.loaded, run.began[i], {first, last}));
  }
}

// One run: makes a testbed, starts both nodes, makes all steps and the outage, and judges them.
Run measure(const Options& o, bool loaded) {
  netns::TestbedOptions options{.name = fmt::format("bench-{}", ::getpid())};
  options.scenario =
      netns::scenario_of({fmt::format("{}=clean", kTested), fmt::format("{}=clean", kOther)}, 1);
  options.backend = o.backend;
  const Testbed testbed = Testbed::up(options);
  const netns::State& state = testbed.state();
  Testbed::change(state, kTested, settings(kBase));
  Testbed::change(state, kOther, settings(kReference));

  const fs::path file = fs::path(o.out) / (loaded ? "loaded.csv" : "idle.csv");
  Child road(start_road(state));
  Child vehicle(start_vehicle(state, loaded, file, o.pcap));
  const Duration phase = from_ms(o.phase_s * 1e3);
  const TimePoint start = io::now();
  Run run;
  run.loaded = loaded;
  const auto all = steps();
  spdlog::info("{}: {} steps, {:.0f} s", loaded ? "under load" : "idle", all.size(),
               o.phase_s * static_cast<double>(all.size() + 1));
  for (const Step& step : all) {
    SignalWatch::sleep(phase);
    must_live(road);
    must_live(vehicle);
    Testbed::change(state, kTested, settings(step.after));
    run.began.push_back(io::now() - start);
    spdlog::info("{} {:g} -> {:g}", name_of(step.what), step.from(), step.to());
  }
  process::SignalWatch::sleep(phase);
  run.end = io::now() - start;
  spdlog::info("outage of {:.0f} s", to_ms(kOutage) / 1e3);
  run.outage_began = io::now() - start;
  Testbed::outage(state, kTested, kOutage);
  SignalWatch::sleep(kOutage + kAfterOutage);
  const int code = vehicle.end();
  road.end();
  if (code != kFine) throw Failure(kFailed, "the vehicle's node failed");
  const Lines lines = read_lines(file);
  run.beliefs = beliefs_of(lines.beliefs, start);
  judge(run);
  std::vector<PathStep> paths;
  for (const PathLine& line : lines.paths) {
    if (line.link == kTestedLink) paths.push_back({line.at - start, line.to});
  }
  run.outage = notice(run.outage_began, paths);
  return run;
}

std::string text(const std::optional<Duration>& d) {
  return d ? fmt::format("{:.2f}", to_ms(*d) / 1e3) : "-";
}

std::string precise(const std::optional<Duration>& d) {
  return d ? fmt::format("{:.3f}", to_ms(*d) / 1e3) : "-";
}

records::Json number(const std::optional<Duration>& d) {
  return d ? records::Json(to_ms(*d) / 1e3) : records::Json();
}

records::Json as_json(const std::vector<Run>& runs, const Options& o) {
  const auto all = steps();
  records::Json out{{"schema", "interneuron.bench.nature/1"},
                    {"phase_s", o.phase_s},
                    {"steps", records::Json::array()}};
  for (const Run& run : runs) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Convergence& c = run.convergence[i];
      out["steps"].push_back({{"load", run.loaded ? "loaded" : "idle"},
                              {"quantity", name_of(all[i].what)},
                              {"unit", unit_of(all[i].what)},
                              {"from", all[i].from()},
                              {"to", all[i].to()},
                              {"last", c.last},
                              {"tolerance", tolerance(all[i].what, all[i].to(), run.loaded)},
                              {"noticed_s", number(c.noticed)},
                              {"settled_s", number(c.settled)},
                              {"ranked_s", number(c.ranked)}});
    }
    out["outages"].push_back({{"load", run.loaded ? "loaded" : "idle"},
                              {"length_s", to_ms(kOutage) / 1e3},
                              {"suspected_s", number(run.outage.suspected)},
                              {"abandoned_s", number(run.outage.abandoned)},
                              {"back_s", number(run.outage.back)}});
  }
  return out;
}

void print(const std::vector<Run>& runs) {
  const auto all = steps();
  fmt::print("{:8} {:5} {:>6} {:>6} {:>8} {:>10} {:>10} {:>10}\n", "load", "what", "from", "to",
             "believed", "noticed s", "settled s", "ranked s");
  for (const Run& run : runs) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Convergence& c = run.convergence[i];
      const double scale = all[i].what == Quantity::kLoss ? 100 : 1;
      const char* unit = all[i].what == Quantity::kLoss ? "%" : "";
      fmt::print("{:8} {:5} {:>6} {:>6} {:>8} {:>10} {:>10} {:>10}\n",
                 run.loaded ? "loaded" : "idle", name_of(all[i].what),
                 fmt::format("{:g}{}", all[i].from() * scale, unit),
                 fmt::format("{:g}{}", all[i].to() * scale, unit),
                 fmt::format("{:.2f}{}", c.last * scale, unit), text(c.noticed), text(c.settled),
                 text(c.ranked));
    }
  }
}

void print_outages(const std::vector<Run>& runs) {
  fmt::print("\n{:8} {:>12} {:>12} {:>24}\n", "outage", "suspected s", "abandoned s",
             "used again, s after end");
  for (const Run& run : runs) {
    fmt::print("{:8} {:>12} {:>12} {:>24}\n", run.loaded ? "loaded" : "idle",
               precise(run.outage.suspected), precise(run.outage.abandoned),
               precise(run.outage.back));
  }
}

int run_nature(const Options& o) {
  if (!o.pcap.empty() && o.load == "both") {
    throw process::Failure(process::kUsage,
                           "--pcap: give --load idle or --load loaded, each makes a capture");
  }
  records::make_directory(o.out);
  const SignalWatch signals;
  std::vector<Run> runs;
  if (o.load != "loaded") runs.push_back(measure(o, false));
  if (o.load != "idle") runs.push_back(measure(o, true));
  const records::Json json = as_json(runs, o);
  records::write_json(fs::path(o.out) / "nature.json", json);
  plot_nature(fs::path(o.out) / "nature.png", runs);
  if (o.json) {
    fmt::print("{}\n", json.dump(2));
  } else {
    print(runs);
    print_outages(runs);
    fmt::print("\nwritten to {}: nature.json, nature.png, one CSV per run\n", o.out);
  }
  return process::kFine;
}

constexpr const char* kFooter =
    "A testbed of its own with two constant links: the one under test makes the steps, the other\n"
    "stays. noticed: the estimate is nearer to the new value than to the old one; settled: within\n"
    "the tolerance to the end of the phase; ranked: the score orders both links as the truth "
    "does.\n"
    "Examples:\n  build/release/bench/nature_bench\n"
    "  build/release/bench/nature_bench --load loaded --phase-s 30";

int run_program(int argc, char** argv) {
  CLI::App program{"How soon a link's estimates and scores follow steps of delay, rate and loss"};
  Options o;
  program.add_option("--load", o.load, "idle, loaded (10 messages of 96 KiB a second) or both")
      ->capture_default_str()
      ->check(CLI::IsMember({"idle", "loaded", "both"}));
  program.add_option("--phase-s", o.phase_s, "Between two steps, seconds")
      ->capture_default_str()
      ->check(CLI::Range(2.0, 600.0));
  add_backend_option(program, o.backend);
  program.add_option("--out", o.out, "Folder for nature.json, nature.png, idle.csv, loaded.csv")
      ->capture_default_str();
  program.add_flag("--json", o.json, "The table as JSON on stdout");
  program
      .add_option("--pcap", o.pcap,
                  "Also write what the vehicle sends and receives to this file (libpcap; needs "
                  "CAP_NET_RAW)")
      ->type_name("FILE");
  program.footer(kFooter);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? process::kFine : process::kUsage;
  }
  return run_nature(o);
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  using namespace interneuron;
  const auto fail = [](int code, const char* what) {
    std::fprintf(stderr, "nature_bench: %s\n", what);
    return code;
  };
  try {
    return bench::run_program(argc, argv);
  } catch (const process::Failure& error) {
    return fail(error.code(), error.what());
  } catch (const netns::TestbedError& error) {
    return fail(error.exit_code, error.what());
  } catch (const std::exception& error) {
    return fail(process::kFailed, error.what());
  }
}
