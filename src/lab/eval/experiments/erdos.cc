// table-erdos, ladder and timeout-handler: ours, its ablations and the baselines under injected
// delays, and while driving.
#include <fmt/format.h>

#include <cmath>

#include "lab/eval/experiments/compare.h"
#include "lab/eval/experiments/document.h"

namespace interneuron::cli::eval {
namespace {

namespace core = interneuron::eval;
using Shape = core::DelayLaw::Shape;

// The laws of docs/evaluation.md; the uniform one is that of table_erdos_scenario().
core::Scenario scenario_of(Shape shape, bool jpeg) {
  core::Scenario scenario = core::table_erdos_scenario();
  scenario.law.shape = shape;
  scenario.profile = core::default_profile(jpeg);
  if (shape == Shape::kNone) {
    scenario.links = {*emu::built_in_profile("5g"), *emu::built_in_profile("4g")};
  }
  return scenario;
}

struct Case {
  const char* name;
  const char* title;
  Shape shape;
  bool jpeg;
};
constexpr Case kCases[] = {
    {"uniform", "Uniform law, raw images", Shape::kUniform, false},
    {"uniform-jpeg", "Uniform law, JPEG instead of raw", Shape::kUniform, true},
    {"exponential", "Heavy-tailed law, raw images", Shape::kExponential, false},
    {"exponential-jpeg", "Heavy-tailed law, JPEG instead of raw", Shape::kExponential, true},
    {"driving", "Driving at 50 km/h over 5G and 4G, raw images", Shape::kNone, false},
    {"driving-jpeg", "Driving at 50 km/h over 5G and 4G, JPEG instead of raw", Shape::kNone, true}};

void add_paper_rows(Json& document) {
  const auto row = [](const char* name, int timeouts, int e2e, double ap, double ar) {
    return Json{{"name", name},
                {"rounds", 300},
                {"timeouts", timeouts},
                {"timeouts_share", timeouts / 300.0},
                {"timeouts_ci95", core::wilson95(static_cast<std::uint64_t>(timeouts), 300)},
                {"e2e_ms", {{"mean", e2e}}},
                {"ap", ap},
                {"ar", ar}};
  };
  document["tables"].push_back(table("paper", "What the paper measured",
                                     "On its own hardware, models and data: only the proportions "
                                     "compare.",
                                     {{"/name", "system"},
                                      {"/rounds", "rounds"},
                                      {"/timeouts", "timeouts"},
                                      {"/timeouts_share", "%", 2, true},
                                      {"/timeouts_ci95", "95 % interval, %", 2, true},
                                      {"/e2e_ms/mean", "e2e mean, ms", 0},
                                      {"/ap", "AP", 3},
                                      {"/ar", "AR", 3}},
                                     Json::array({row("INTERNEURON", 8, 114, 0.472, 0.624),
                                                  row("ERDOS", 152, 109, 0.508, 0.673)})));
}

std::string note_of_jpeg() {
  return "JPEG: quality 80 of the full frame takes raw's place; its boxes are scored as those "
         "recorded on raw (docs/evaluation.md, Limits).";
}

Json paired(const std::vector<double>& differences) {
  const core::Paired p = core::paired95(differences);
  return {{"mean", p.mean}, {"ci95", p.ci95 ? Json(*p.ci95) : Json(nullptr)}};
}

Json ladder_rows(const Compared& compared) {
  constexpr double kPerRounds = 300;  // as the paper counts timeouts
  const auto& ours = compared.runs.front();
  Json rows = Json::array();
  for (std::size_t i = 0; i < compared.systems.size(); ++i) {
    std::vector<double> timeouts;
    std::vector<double> quality;
    for (std::size_t s = 0; s < ours.size(); ++s) {
      const auto f = [&](const core::Run& run) {
        return core::figures({&run, 1}, compared.scenario.profile);
      };
      const core::Figures a = f(compared.runs[i][s]);
      const core::Figures b = f(ours[s]);
      timeouts.push_back(kPerRounds *
                         (static_cast<double>(a.timeouts) - static_cast<double>(b.timeouts)) /
                         static_cast<double>(a.rounds));
      quality.push_back(a.quality - b.quality);
    }
    const core::System& system = compared.systems[i];
    rows.push_back({{"name", system.name},
                    {"about", system.about},
                    {"baseline", system.is_baseline},
                    {"seeds", ours.size()},
                    {"more_timeouts_per_300", paired(timeouts)},
                    {"more_quality", paired(quality)}});
  }
  return rows;
}

}  // namespace

void add_example(Json& document, const Compared& compared, const std::string& system) {
  for (std::size_t i = 0; i < compared.systems.size(); ++i) {
    if (compared.systems[i].name != system) continue;
    Json points = Json::array();
    for (const core::Round& r : compared.runs[i].front().rounds) {
      points.push_back({r.round, std::round(to_ms(r.e2e) * 100) / 100, r.on_time ? 1 : 0});
    }
    document["series"].push_back({{"name", system}, {"unit", "ms"}, {"points", points}});
  }
}

void run_table_erdos(const Request& request, Json& document) {
  add_paper_rows(document);
  for (const Case& c : kCases) {
    const core::Scenario scenario = scenario_of(c.shape, c.jpeg);
    const Compared compared =
        compare(request, fmt::format("table-erdos {}", c.name), scenario, all_systems(c.jpeg));
    document["tables"].push_back(
        table(c.name, c.title, describe(scenario), system_columns(), rows_of(request, compared)));
    if (&c == kCases) {
      for (const char* name : {"ours", "erdos_like"}) add_example(document, compared, name);
    }
  }
  document["notes"].push_back(note_of_jpeg());
}

void run_ladder(const Request& request, Json& document) {
  for (const Case& c : {kCases[0], kCases[2], kCases[4]}) {
    const core::Scenario scenario = scenario_of(c.shape, c.jpeg);
    const Compared compared =
        compare(request, fmt::format("ladder {}", c.name), scenario, all_systems(c.jpeg), false);
    document["tables"].push_back(
        table(c.name, c.title,
              describe(scenario) + " Each system against ours on the same seeds; 95 % intervals by "
                                   "Student's t over the seeds.",
              {{"/name", "system"},
               {"/about", "what it is"},
               {"/more_timeouts_per_300/mean", "timeouts more, of 300", 2},
               {"/more_timeouts_per_300/ci95", "95 % interval", 2},
               {"/more_quality/mean", "quality more", 4},
               {"/more_quality/ci95", "95 % interval", 4}},
              ladder_rows(compared)));
  }
}

void run_timeout_handler(const Request& request, Json& document) {
  const std::vector<core::System> systems{*core::find_system("no_handler"),
                                          *core::find_system("paper"), *core::find_system("ours")};
  for (const Case& c : {kCases[0], kCases[2], kCases[4]}) {
    const core::Scenario scenario = scenario_of(c.shape, c.jpeg);
    const Compared compared =
        compare(request, fmt::format("timeout-handler {}", c.name), scenario, systems, false);
    Json rows = rows_of(request, compared);
    const auto without = rows[0]["consecutive"].get<double>();
    for (std::size_t i = 1; i < rows.size(); ++i) {
      rows[i]["consecutive_change"] =
          without > 0 ? Json(rows[i]["consecutive"].get<double>() / without - 1) : Json(nullptr);
    }
    document["tables"].push_back(table(c.name, c.title, describe(scenario),
                                       {{"/name", "system"},
                                        {"/rounds", "rounds"},
                                        {"/timeouts", "timeouts"},
                                        {"/timeouts_ci95", "95 % interval, %", 2, true},
                                        {"/consecutive", "missed right after a miss"},
                                        {"/consecutive_change", "against no_handler, %", 1, true},
                                        {"/quality", "quality", 4}},
                                       rows));
  }
  document["notes"].push_back(
      "The paper: 78 % fewer timeouts in a row with the handler. no_handler is guard `paper` "
      "without "
      "it; ours, guard `budget`, has none.");
}

}  // namespace interneuron::cli::eval
