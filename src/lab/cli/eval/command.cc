#include "lab/cli/commands.h"

#include <fmt/format.h>

#include <charconv>
#include <memory>
#include <optional>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/records/staging.h"
#include "app/settings/data.h"
#include "lab/cli/eval/experiments.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/findings.h"

namespace interneuron::cli {
namespace {

using experiments::Document;
using experiments::Experiment;

constexpr const char* kAll = "all";
// The most seeds of one run, so that a mistyped range is refused and not computed for days.
constexpr std::uint64_t kMostSeeds = 10'000;
// The default number of seeds with --testbed, where 300 rounds of a system take half a minute.
constexpr std::uint64_t kTestbedSeeds = 3;

// Deadlines of the testbed: no image arrives within 50 ms, and rounds of a second and more begin to
// pile up at 10 Hz.
constexpr double kLeastDeadlineMs = 50;
constexpr double kMostDeadlineMs = 1000;

struct EvalOptions {
  std::string experiment;
  std::optional<std::uint32_t> rounds;
  std::string seeds;
  // Empty: default_out() says where.
  std::string out;
  bool sim = false;
  bool testbed = false;
  bool encrypted = false;
  std::string ladder = "auto";
  std::optional<double> deadline_ms;
  std::string data;
  bool json = false;
};

std::string names() {
  std::string out;
  for (const Experiment& e : all_experiments()) out += fmt::format("{}, ", e.name);
  return out + kAll;
}

std::pair<std::uint64_t, std::uint64_t> parse_seeds(const std::string& text) {
  const auto number = [](std::string_view s, std::uint64_t& value) {
    const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
    return error == std::errc{} && end == s.data() + s.size();
  };
  const std::size_t dots = text.find("..");
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  const bool good = dots == std::string::npos ? number(text, first) && number(text, last)
                                              : number(text.substr(0, dots), first) &&
                                                    number(text.substr(dots + 2), last);
  if (!good || last < first || last - first >= kMostSeeds) {
    throw process::Failure(process::kUsage,
                           fmt::format("--seeds '{}': give FIRST..LAST, as 1..30, at most {} seeds",
                                       text, kMostSeeds));
  }
  return {first, last};
}

// The testbed's documents have the simulation's names, so they have a folder of their own.
std::string default_out(bool testbed) { return testbed ? "out/eval-testbed" : "out/eval"; }

Document run_one(const Experiment& experiment, const EvalOptions& o,
                 const experiments::Scorer& scorer, const std::filesystem::path& scratch,
                 process::Progress& progress) {
  std::pair<std::uint64_t, std::uint64_t> seeds{1, o.testbed ? kTestbedSeeds : experiment.seeds};
  if (!o.seeds.empty()) seeds = parse_seeds(o.seeds);
  std::optional<Duration> deadline;
  if (o.deadline_ms) deadline = from_ms(*o.deadline_ms);
  const experiments::Request request{.rounds = o.rounds.value_or(experiment.rounds),
                                     .first_seed = seeds.first,
                                     .last_seed = seeds.second,
                                     .scorer = scorer,
                                     .progress = progress,
                                     .data = settings::find_data(o.data),
                                     .scratch = scratch,
                                     .ladder = o.ladder,
                                     .deadline = deadline,
                                     .is_encrypted = o.encrypted};
  Document document{.experiment = experiment.name,
                    .title = experiment.title,
                    .mode = o.testbed ? "testbed" : "sim",
                    .seeds = {{request.first_seed, request.last_seed}},
                    .rounds_per_seed = request.rounds,
                    .tables = {},
                    .series = {},
                    .waterfalls = {},
                    .notes = {}};
  (o.testbed ? experiment.run_on_testbed : experiment.run)(request, document);
  if (o.encrypted) document.notes.push_back("The endpoints have keys: every packet is encrypted.");
  if (experiment.scored && !scorer.missing().empty()) {
    document.notes.push_back("AP and AR are not known: " + scorer.missing() + ".");
  }
  return document;
}

void say(const Document& document) {
  print_document(document);
  for (const experiments::Finding& finding : experiments::findings(document)) {
    fmt::print("{} {}\n", experiments::mark(finding.kind), finding.text);
  }
}

// Ends here if this experiment is none of those that are able to do it.
void refuse_unless(const std::string& experiment, bool (*able)(const Experiment&),
                   const char* trouble) {
  const Experiment* found = find_experiment(experiment);
  if (found != nullptr && able(*found)) return;
  std::string others;
  for (const Experiment& e : all_experiments()) {
    if (able(e)) others += (others.empty() ? "" : ", ") + std::string(e.name);
  }
  throw process::Failure(process::kUsage, fmt::format("{} {}: {}", experiment, trouble, others));
}

int run_eval(const EvalOptions& o) {
  if (o.experiment != kAll && find_experiment(o.experiment) == nullptr) {
    throw process::Failure(process::kUsage,
                           fmt::format("no experiment '{}'; there are {}", o.experiment, names()));
  }
  if (o.testbed) {
    refuse_unless(
        o.experiment, [](const Experiment& e) { return e.run_on_testbed != nullptr; },
        "is for virtual time alone; on the testbed");
  }
  if (o.encrypted) {
    refuse_unless(
        o.experiment, [](const Experiment& e) { return e.encryptable; },
        "is not for --encrypted; those that are");
  }
  if (!o.testbed && o.ladder != EvalOptions{}.ladder) {
    throw process::Failure(process::kUsage, "--ladder " + o.ladder + ": only with --testbed");
  }
  if (!o.testbed && o.deadline_ms)
    throw process::Failure(process::kUsage, "--deadline-ms: only with --testbed");
  if (o.rounds && *o.rounds == 0)
    throw process::Failure(process::kUsage, "--rounds 0: give at least 1");
  if (!o.seeds.empty()) parse_seeds(o.seeds);
  const process::SignalWatch signals;
  const std::string out = o.out.empty() ? default_out(o.testbed) : o.out;
  records::Staging staging(out);
  const experiments::Scorer scorer(settings::find_data(o.data), !o.data.empty());
  process::Progress progress;
  records::Json documents = records::Json::array();
  for (const Experiment& experiment : all_experiments()) {
    if (o.experiment != kAll && o.experiment != experiment.name) continue;
    const std::filesystem::path scratch = staging / ".testbed";
    const Document document = run_one(experiment, o, scorer, scratch, progress);
    documents.push_back(to_json(document));
    std::filesystem::remove_all(scratch);
    records::write_json(staging / (std::string(experiment.name) + ".json"), documents.back());
    if (!o.json) say(document);
  }
  staging.publish();
  if (o.json) {
    fmt::print("{}\n", (o.experiment == kAll ? documents : documents[0]).dump(2));
  } else {
    fmt::print("\nwritten to {}; `interneuron report {}` makes a page of it\n", out, out);
  }
  return process::kFine;
}

}  // namespace

void add_eval(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<EvalOptions>();
  CLI::App* c = program.add_subcommand(
      "eval", "The paper's experiments and more, ours beside baselines and bounds");
  c->add_option("EXPERIMENT", o->experiment, names())->required();
  c->add_option("--rounds", o->rounds, "Rounds per seed (default: the experiment's)");
  c->add_option("--seeds", o->seeds, "FIRST..LAST (default: the experiment's, from 1)");
  CLI::Option* sim = c->add_flag("--sim", o->sim, "In virtual time; the default");
  CLI::Option* testbed =
      c->add_flag("--testbed", o->testbed,
                  "On real sockets, emulated links and real detection, encrypted: table-erdos "
                  "alone, 3 seeds")
          ->excludes(sim);
  c->add_flag("--encrypted", o->encrypted,
              "In virtual time: the endpoints have keys, as those of `vehicle` and `road`")
      ->excludes(testbed);
  c->add_option(
       "--ladder", o->ladder,
       "Detectors of the testbed; replay has recorded boxes and times and computes nothing")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "dnn", "motion", "replay"}));
  c->add_option("--deadline-ms", o->deadline_ms,
                "Deadline of the testbed's rounds (default: 19 ms after the end of undisturbed "
                "ones)")
      ->check(CLI::Range(kLeastDeadlineMs, kMostDeadlineMs));
  c->add_option("--out", o->out,
                "Folder for one EXPERIMENT.json each (default: out/eval, with --testbed "
                "out/eval-testbed)");
  c->add_option("--data", o->data,
                "Folder with recorded detections and ground truth (default: INTERNEURON_DATA, "
                "../shared/data, build/data; without any, AP and AR are left out)");
  c->add_flag("--json", o->json, "The documents as JSON on stdout (docs/schema/eval.json)");
  std::string footer = "Experiments, with their rounds and seeds:\n";
  for (const Experiment& e : all_experiments()) {
    footer += fmt::format("  {:16} {} ({} x {})\n", e.name, e.title, e.seeds, e.rounds);
  }
  c->footer(footer +
            "Examples:\n  interneuron eval fig-rt\n  interneuron eval table-erdos --seeds 1..5\n"
            "  interneuron eval table-erdos --testbed --seeds 1..1\n"
            "  interneuron eval all && interneuron report out/eval");
  c->callback([&run, o] { run = [o] { return run_eval(*o); }; });
}

}  // namespace interneuron::cli
