// table-erdos, ladder and timeout-handler: ours, its ablations and the baselines under injected
// delays, and while driving.
#include <fmt/format.h>

#include <cmath>

#include "lab/eval/experiments/compare.h"
#include "lab/eval/experiments/document.h"

namespace interneuron::experiments {
namespace {

using Shape = eval::DelayLaw::Shape;

// The laws of docs/evaluation.md, "Delays".
enum class Law : std::uint8_t { kUniform, kPerNic, kExponential, kDriving };

struct TableLaw {
  const char* name;
  const char* title;
  Law law;
  bool jpeg = false;
  // A round begins when the one before is over.
  bool sequential = false;
};
constexpr TableLaw kUniform{"uniform", "Uniform law, raw images", Law::kUniform};
constexpr TableLaw kPerNic{"per-nic", "Delays of one network, as in the paper, raw images",
                           Law::kPerNic};
constexpr TableLaw kExponential{"exponential", "Heavy-tailed law, raw images", Law::kExponential};
constexpr TableLaw kDriving{"driving", "Driving at 50 km/h over 5G and 4G, raw images",
                            Law::kDriving};
constexpr TableLaw kTableLaws[] = {
    kUniform,
    {"uniform-jpeg", "Uniform law, JPEG instead of raw", Law::kUniform, true},
    kPerNic,
    {"per-nic-jpeg", "Delays of one network, JPEG instead of raw", Law::kPerNic, true},
    kExponential,
    {"exponential-jpeg", "Heavy-tailed law, JPEG instead of raw", Law::kExponential, true},
    kDriving,
    {"driving-jpeg", "Driving at 50 km/h over 5G and 4G, JPEG instead of raw", Law::kDriving,
     true}};

eval::Scenario scenario_of(const TableLaw& c) {
  // A period longer than the deadline, so that the outcome of each round is known, here and
  // at the roadside, before the next one begins.
  constexpr Duration kSequential = std::chrono::milliseconds(140);
  eval::Scenario scenario = eval::table_erdos_scenario();
  scenario.profile = eval::default_profile(c.jpeg);
  if (c.sequential) scenario.period = kSequential;
  switch (c.law) {
    case Law::kUniform:
      break;
    case Law::kPerNic:
      scenario.law = eval::per_nic_law();
      break;
    case Law::kExponential:
      scenario.law.shape = Shape::kExponential;
      break;
    case Law::kDriving:
      scenario.law.shape = Shape::kNone;
      scenario.links = {*emu::built_in_profile("5g"), *emu::built_in_profile("4g")};
      break;
  }
  return scenario;
}

Table paper_table() {
  const auto row = [](const char* name, std::uint64_t timeouts, int e2e, double ap, double ar) {
    constexpr std::uint64_t kRounds = 300;
    return PaperRow{.name = name,
                    .rounds = kRounds,
                    .timeouts = timeouts,
                    .timeouts_share = static_cast<double>(timeouts) / kRounds,
                    .timeouts_ci95 = eval::wilson95(timeouts, kRounds),
                    .e2e_ms = {e2e},
                    .ap = ap,
                    .ar = ar};
  };
  return {
      "paper",
      "What the paper measured",
      "On its own hardware, models and data: only the proportions compare.",
      {{"/name", "system"},
       {"/rounds", "rounds"},
       {"/timeouts", "timeouts"},
       {"/timeouts_share", "%", 2, true},
       {"/timeouts_ci95", "95 % interval, %", 2, true},
       {"/e2e_ms/mean", "e2e mean, ms", 0},
       {"/ap", "AP", 3},
       {"/ar", "AR", 3}},
      std::vector{row("INTERNEURON", 8, 114, 0.472, 0.624), row("ERDOS", 152, 109, 0.508, 0.673)}};
}

std::string note_of_jpeg() {
  return "JPEG: quality 80 of the full frame takes raw's place; its boxes are scored as those "
         "recorded on raw (docs/evaluation.md, Limits).";
}

std::vector<LadderRow> ladder_rows(const Compared& compared) {
  // The paper counts the timeouts of so many rounds.
  constexpr double kPerRounds = 300;
  const auto& ours = compared.runs.front();
  std::vector<LadderRow> rows;
  for (std::size_t i = 0; i < compared.systems.size(); ++i) {
    std::vector<double> timeouts;
    std::vector<double> quality;
    for (std::size_t s = 0; s < ours.size(); ++s) {
      const auto f = [&](const eval::Run& run) {
        return eval::figures({&run, 1}, compared.scenario.profile);
      };
      const eval::Figures a = f(compared.runs[i][s]);
      const eval::Figures b = f(ours[s]);
      timeouts.push_back(kPerRounds *
                         (static_cast<double>(a.timeouts) - static_cast<double>(b.timeouts)) /
                         static_cast<double>(a.rounds));
      quality.push_back(a.quality - b.quality);
    }
    const eval::System& system = compared.systems[i];
    rows.push_back({.name = system.name,
                    .about = system.about,
                    .baseline = system.is_baseline,
                    .seeds = ours.size(),
                    .more_timeouts_per_300 = eval::paired95(timeouts),
                    .more_quality = eval::paired95(quality)});
  }
  return rows;
}

}  // namespace

void add_example(Document& document, const Compared& compared, const std::string& system) {
  for (std::size_t i = 0; i < compared.systems.size(); ++i) {
    if (compared.systems[i].name != system) continue;
    Series series{system, "ms", {}};
    for (const eval::Round& r : compared.runs[i].front().rounds) {
      series.points.push_back(
          {static_cast<double>(r.round), std::round(to_ms(r.e2e) * 100) / 100, r.on_time});
    }
    document.series.push_back(std::move(series));
  }
}

void run_table_erdos(const Request& request, Document& document) {
  document.tables.push_back(paper_table());
  for (const TableLaw& c : kTableLaws) {
    const eval::Scenario scenario = scenario_of(c);
    const Compared compared = compare(request, fmt::format("table-erdos {}", c.name), scenario,
                                      all_systems(scenario, c.jpeg));
    document.tables.push_back(
        {c.name, c.title, describe(scenario), system_columns(), system_rows(request, compared)});
    if (&c == kTableLaws) {
      for (const char* name : {"ours", "erdos_like"}) add_example(document, compared, name);
    }
  }
  document.notes.push_back(note_of_jpeg());
}

void run_ladder(const Request& request, Document& document) {
  for (const TableLaw& c : {kUniform, kPerNic, kExponential, kDriving}) {
    const eval::Scenario scenario = scenario_of(c);
    std::vector<eval::System> systems = all_systems(scenario, c.jpeg);
    std::erase_if(systems, [](const eval::System& s) { return s.is_bound(); });
    const Compared compared =
        compare(request, fmt::format("ladder {}", c.name), scenario, systems, false);
    document.tables.push_back({c.name,
                               c.title,
                               describe(scenario) +
                                   " Each system against ours on the same seeds; 95 % intervals by "
                                   "Student's t over the seeds.",
                               {{"/name", "system"},
                                {"/about", "what it is"},
                                {"/more_timeouts_per_300/mean", "timeouts more, of 300", 2},
                                {"/more_timeouts_per_300/ci95", "95 % interval", 2},
                                {"/more_quality/mean", "quality more", 4},
                                {"/more_quality/ci95", "95 % interval", 4}},
                               ladder_rows(compared)});
  }
}

void run_timeout_handler(const Request& request, Document& document) {
  const std::vector<eval::System> systems{*eval::find_system("no_handler"),
                                          *eval::find_system("paper"), *eval::find_system("ours")};
  static constexpr TableLaw kSequential[] = {
      {"uniform-sequential", "Uniform law, one round after the other", Law::kUniform, false, true},
      {"per-nic-sequential", "Delays of one network, one round after the other", Law::kPerNic,
       false, true}};
  for (const TableLaw& c :
       {kUniform, kSequential[0], kPerNic, kSequential[1], kExponential, kDriving}) {
    const eval::Scenario scenario = scenario_of(c);
    const Compared compared =
        compare(request, fmt::format("timeout-handler {}", c.name), scenario, systems, false);
    std::vector<SystemRow> rows = system_rows(request, compared);
    const auto without = static_cast<double>(rows.front().consecutive.value_or(0));
    for (std::size_t i = 1; i < rows.size(); ++i) {
      SystemRow::Handler& handler = rows[i].handler.emplace();
      if (without <= 0) continue;
      handler.consecutive_change = static_cast<double>(*rows[i].consecutive) / without - 1;
    }
    document.tables.push_back({c.name,
                               c.title,
                               describe(scenario),
                               {{"/name", "system"},
                                {"/rounds", "rounds"},
                                {"/timeouts", "timeouts"},
                                {"/timeouts_ci95", "95 % interval, %", 2, true},
                                {"/consecutive", "missed right after a miss"},
                                {"/consecutive_change", "against no_handler, %", 1, true},
                                {"/quality", "quality", 4}},
                               std::move(rows)});
  }
  document.notes.push_back(
      "The paper: 78 % fewer timeouts in a row with the handler. no_handler is guard `paper` "
      "without it; ours, guard `budget`, has none. At 10 frames per second the next round has "
      "begun before a round of 130 ms is missed, so the handler acts one round late; with one "
      "round after the other it acts at once.");
}

}  // namespace interneuron::experiments
