#include "lab/eval_testbed/testbed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "app/settings/data.h"
#include "core/base/statistics.h"
#include "lab/eval/experiments/compare.h"

namespace interneuron::eval_testbed {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSystems[] = {"ours", "paper", "erdos_like"};
// Simulation and testbed agree when the share of rounds on time differs by at most 2 points, of
// erdos_like, whose rounds end close to the deadline, by 3, the median end-to-end time by at most
// 5 %, and the median of undisturbed uplinks by at most 1.5 ms.
constexpr double kOnTimePoints = 0.02;
constexpr double kErdosPoints = 0.03;
// Shares of rounds are sums of doubles: the bound itself still agrees.
constexpr double kRounding = 1e-9;
constexpr double kE2eShare = 0.05;
constexpr double kUplinkMs = 1.5;
// Even a short experiment runs so many undisturbed rounds, 2 s, to learn the medians that
// erdos_like freezes.
constexpr std::uint32_t kFewestUndisturbed = 20;

// [system][seed].
using BenchRuns = std::vector<std::vector<BenchRun>>;

BenchRuns run_all(const experiments::Request& request, const eval::Scenario& scenario,
                  const std::vector<eval::System>& systems, Bench& bench) {
  BenchRuns out(systems.size());
  const std::size_t count = systems.size() * request.seeds();
  const double seconds = request.rounds * to_ms(scenario.period) / 1e3;
  std::size_t done = 0;
  for (std::uint64_t seed = request.first_seed; seed <= request.last_seed; ++seed) {
    const eval::Trace trace = eval::make_trace(scenario.law, seed, request.rounds);
    for (std::size_t i = 0; i < systems.size(); ++i) {
      fmt::print(stderr, "testbed: run {} of {}: {}, seed {}, {:.0f} s\n", ++done, count,
                 systems[i].name, seed, seconds);
      out[i].push_back(bench.run(systems[i], trace, seed));
    }
  }
  return out;
}

std::optional<perception::GroundTruth> truth_of(const experiments::Request& request) {
  const auto file = settings::default_truth(request.data);
  if (!file) return std::nullopt;
  return perception::read_mot_truth(*file);
}

// Adds the accuracy of the boxes that the application got to a system's row; null without a ground
// truth.
void add_boxes(const std::optional<perception::GroundTruth>& truth,
               const std::vector<BenchRun>& runs, experiments::SystemRow& row) {
  row.ap = row.ar = row.effective_ap = row.effective_ar = std::nullopt;
  if (!truth) return;
  std::vector<perception::Shown> every;
  std::vector<perception::Shown> on_time;
  for (const BenchRun& bench : runs) {
    for (std::size_t i = 0; i < bench.boxes.size(); ++i) {
      every.push_back(bench.boxes[i]);
      if (bench.run.rounds[i].on_time) on_time.push_back(bench.boxes[i]);
    }
  }
  const perception::Accuracy effective = perception::evaluate(*truth, every);
  row.effective_ap = effective.ap;
  row.effective_ar = effective.ar;
  if (on_time.empty()) return;
  const perception::Accuracy paper = perception::evaluate(*truth, on_time);
  row.ap = paper.ap;
  row.ar = paper.ar;
}

// Medians of what undisturbed rounds with one image took, by part.
struct Parts {
  std::size_t rounds = 0;
  double uplink_ms = 0;
  double compute_ms = 0;
  double downlink_ms = 0;
};
Parts parts_of(const std::vector<eval::Run>& runs, std::size_t variant) {
  std::vector<double> uplink;
  std::vector<double> compute;
  std::vector<double> downlink;
  for (const eval::Run& run : runs) {
    for (const eval::Round& r : run.rounds) {
      if (r.injected.any || !r.on_time || r.variant != variant || !r.compute_ended) continue;
      uplink.push_back(to_ms(*r.delivered));
      compute.push_back(to_ms(*r.compute_ended - *r.delivered));
      downlink.push_back(to_ms(r.e2e - *r.compute_ended));
    }
  }
  return {uplink.size(), percentile(uplink, 0.5), percentile(compute, 0.5),
          percentile(downlink, 0.5)};
}

// The variant that most of the undisturbed rounds used.
std::size_t usual_variant(const eval::Profile& profile, const std::vector<eval::Run>& runs) {
  std::size_t usual = 0;
  for (std::size_t v = 1; v < profile.variants.size(); ++v) {
    if (parts_of(runs, v).rounds > parts_of(runs, usual).rounds) usual = v;
  }
  return usual;
}

experiments::AgreementRow agreement_row(const std::string& name, const eval::Profile& profile,
                                        const std::vector<eval::Run>& testbed,
                                        const std::vector<eval::Run>& sim) {
  const eval::Figures real = eval::figures(testbed, profile);
  const eval::Figures virtual_time = eval::figures(sim, profile);
  const auto on_time = [](const eval::Figures& f) {
    return 1 - static_cast<double>(f.timeouts) / static_cast<double>(f.rounds);
  };
  const double points = on_time(real) - on_time(virtual_time);
  const double change =
      virtual_time.e2e_p50_ms > 0 ? real.e2e_p50_ms / virtual_time.e2e_p50_ms - 1 : 0;
  const std::size_t variant = usual_variant(profile, testbed);
  const Parts parts = parts_of(testbed, variant);
  const Parts simulated = parts_of(sim, variant);
  const auto part = [&](double Parts::*which) {
    const auto value = [which](const Parts& p) {
      return p.rounds > 0 ? std::optional(p.*which) : std::nullopt;
    };
    return experiments::Sides{value(parts), value(simulated)};
  };
  const experiments::Sides uplink = part(&Parts::uplink_ms);
  std::optional<bool> uplink_agrees;
  if (uplink.testbed && uplink.sim) {
    uplink_agrees = std::abs(*uplink.testbed - *uplink.sim) <= kUplinkMs;
  }
  const double aim = name == "erdos_like" ? kErdosPoints : kOnTimePoints;
  return {.name = name,
          .image = profile.variants[variant].name,
          .on_time = {on_time(real), on_time(virtual_time), points},
          .e2e_p50_ms = {real.e2e_p50_ms, virtual_time.e2e_p50_ms, change},
          .uplink_ms = uplink,
          .compute_ms = part(&Parts::compute_ms),
          .downlink_ms = part(&Parts::downlink_ms),
          .points_aim = aim,
          .on_time_agrees = std::abs(points) <= aim + kRounding,
          .e2e_agrees = std::abs(change) <= kE2eShare,
          .uplink_agrees = uplink_agrees};
}

experiments::Table agreement(const experiments::Compared& testbed,
                             const experiments::Compared& sim) {
  std::vector<experiments::AgreementRow> rows;
  for (std::size_t i = 0; i < testbed.systems.size(); ++i) {
    rows.push_back(agreement_row(testbed.systems[i].name, testbed.scenario.profile, testbed.runs[i],
                                 sim.runs[i]));
  }
  return {"agreement",
          "Testbed and simulation",
          "The same seeds, delays, deadline and systems; the simulation has the run times that the "
          "levels had on the testbed, and what its hosts took in undisturbed rounds. Parts: "
          "medians of undisturbed rounds on time with the "
          "image that most of them used.",
          {{"/name", "system"},
           {"/on_time/testbed", "on time, testbed, %", 2, true},
           {"/on_time/sim", "simulation, %", 2, true},
           {"/on_time/points", "difference, points", 2, true},
           {"/on_time_agrees", "agrees"},
           {"/e2e_p50_ms/testbed", "e2e p50, testbed, ms", 1},
           {"/e2e_p50_ms/sim", "simulation, ms", 1},
           {"/e2e_agrees", "within 5 %"},
           {"/image", "parts with"},
           {"/uplink_ms/testbed", "uplink, testbed, ms", 1},
           {"/uplink_ms/sim", "simulation, ms", 1},
           {"/uplink_agrees", "within 1.5 ms"},
           {"/compute_ms/testbed", "computation, testbed, ms", 1},
           {"/compute_ms/sim", "simulation, ms", 1},
           {"/downlink_ms/testbed", "downlink, testbed, ms", 1},
           {"/downlink_ms/sim", "simulation, ms", 1}},
          std::move(rows)};
}

experiments::Table level_table(const eval::Profile& calibrated, const eval::Profile& measured) {
  std::vector<experiments::LevelTimesRow> rows;
  for (std::size_t i = 0; i < measured.levels.size(); ++i) {
    rows.push_back({measured.level_names[i], to_ms(calibrated.levels[i].median),
                    to_ms(calibrated.levels[i].p95), to_ms(measured.levels[i].median),
                    to_ms(measured.levels[i].p95)});
  }
  return {"levels",
          "Run times of the levels on this machine",
          "Calibrated before the first run, and in operation, without what was injected; a "
          "level that hardly ran in operation keeps its calibrated times.",
          {{"/name", "level"},
           {"/calibrated_ms", "calibrated p50, ms", 1},
           {"/calibrated_p95_ms", "p95", 1},
           {"/measured_ms", "in operation p50, ms", 1},
           {"/measured_p95_ms", "p95", 1}},
          std::move(rows)};
}

std::string load() {
  double averages[1] = {};
  if (::getloadavg(averages, 1) != 1) return "not known";
  return fmt::format("{:.1f}", averages[0]);
}

// Whether the recorded boxes are of these levels: they are of the nets of the dnn and replay
// ladders, and worth nothing for the motion ladder's.
bool is_recorded(const eval::Profile& profile) {
  return profile.level_names.front().starts_with("yolo");
}

// What a reader of the tables must know. `undisturbed`: rounds of the calibration.
void add_notes(experiments::Document& document, const experiments::Request& request,
               const Bench& bench, std::uint32_t undisturbed, bool has_truth) {
  document.notes.push_back(
      fmt::format("Real sockets in network namespaces, links by the emulator, {}. AP and AR of "
                  "the testbed's rows are of the boxes that the application got{}.",
                  bench.ladder(), has_truth ? "" : ", and are not known without the ground truth"));
  document.notes.push_back(fmt::format(
      "Deadline: {:.1f} ms{}. {} undisturbed rounds took {:.1f} ms to submit an image, {:.1f} ms "
      "longer in the uplink and {:.1f} ms longer in the downlink than in virtual time; the "
      "simulation has these times.",
      to_ms(bench.deadline()),
      request.deadline ? ""
                       : fmt::format(", {:.0f} ms after the end of an undisturbed round at the "
                                     "highest level",
                                     to_ms(kSlack)),
      undisturbed, to_ms(bench.hosts().encode), to_ms(bench.hosts().image_packets),
      to_ms(bench.hosts().result_packets)));
}

}  // namespace

void run_table_erdos_on_testbed(const experiments::Request& request,
                                experiments::Document& document) {
  eval::Scenario scenario = eval::table_erdos_scenario();
  const std::vector<eval::System> systems = experiments::some_systems(kSystems);
  const std::string load_before = load();
  Bench bench(scenario, request.data, request.ladder, request.scratch);
  const std::uint32_t undisturbed =
      std::clamp(request.rounds, kFewestUndisturbed, eval::kErdosRounds);
  fmt::print(stderr, "testbed: calibrating the detectors, {} undisturbed rounds\n", undisturbed);
  bench.calibrate(undisturbed, request.deadline);
  fmt::print(stderr, "testbed: {}\n", bench.ladder());
  const BenchRuns runs = run_all(request, scenario, systems, bench);

  scenario.profile = measured(bench.profile(), runs);
  scenario.erdos = bench.erdos();
  scenario.deadline = bench.deadline();
  scenario.hosts = bench.hosts();
  scenario.learns_budget = true;
  const experiments::Scorer nothing(std::nullopt, false);
  const experiments::Request scored{
      .rounds = request.rounds,
      .first_seed = request.first_seed,
      .last_seed = request.last_seed,
      .scorer = is_recorded(scenario.profile) ? request.scorer : nothing,
      .progress = request.progress,
      // The programs have keys.
      .is_encrypted = true};
  const experiments::Compared sim = compare(scored, "the same in virtual time", scenario, systems);
  experiments::Compared testbed{scenario, systems, {}, sim.oracle, sim.causal};
  for (const std::vector<BenchRun>& of_system : runs) {
    auto& of = testbed.runs.emplace_back();
    for (const BenchRun& bench_run : of_system) of.push_back(bench_run.run);
  }
  std::vector<experiments::SystemRow> rows = system_rows(scored, testbed);
  const auto truth = truth_of(request);
  for (std::size_t i = 0; i < systems.size(); ++i) add_boxes(truth, runs[i], rows[i]);
  document.tables.push_back({"uniform", "On the testbed, uniform law, raw images",
                             experiments::describe(scenario), experiments::system_columns(),
                             std::move(rows)});
  document.tables.push_back({"uniform-sim", "The same in virtual time",
                             experiments::describe(scenario), experiments::system_columns(),
                             system_rows(scored, sim)});
  document.tables.push_back(agreement(testbed, sim));
  document.tables.push_back(level_table(bench.profile(), scenario.profile));
  for (const char* name : {"ours", "erdos_like"}) add_example(document, testbed, name);
  add_notes(document, request, bench, undisturbed, truth.has_value());
  document.notes.push_back(
      fmt::format("Load average of this machine (1 min) before: {}, after: {}. The oracle has the "
                  "run times of the simulation.",
                  load_before, load()));
}

}  // namespace interneuron::eval_testbed
