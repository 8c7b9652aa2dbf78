// sweep: the deadline from tight to loose, and the injected delays from none to twice the law's.
#include <fmt/format.h>

#include "lab/eval/experiments/compare.h"
#include "lab/eval/experiments/document.h"

namespace interneuron::cli::eval {
namespace {

namespace core = interneuron::eval;

constexpr int kDeadlinesMs[] = {60, 80, 100, 130, 160, 200};
constexpr double kSeverities[] = {0, 0.5, 1, 2};
constexpr const char* kSystems[] = {"ours", "paper", "erdos_like", "erdos_e2e", "duplicate_e2e"};

Duration scaled(Duration d, double by) {
  return Duration{static_cast<std::int64_t>(static_cast<double>(d.count()) * by)};
}

}  // namespace

void run_sweep(const Request& request, Json& document) {
  const std::vector<core::System> systems = some_systems(kSystems);
  for (const double severity : kSeverities) {
    Json rows = Json::array();
    core::Scenario scenario = core::table_erdos_scenario();
    scenario.law.low = scaled(scenario.law.low, severity);
    scenario.law.high = scaled(scenario.law.high, severity);
    if (severity == 0) scenario.law.shape = core::DelayLaw::Shape::kNone;
    for (const int deadline : kDeadlinesMs) {
      scenario.deadline = std::chrono::milliseconds(deadline);
      const Compared compared =
          compare(request, fmt::format("sweep {} ms, severity {:g}", deadline, severity), scenario,
                  systems);
      for (Json row : rows_of(request, compared)) {
        row["deadline_ms"] = deadline;
        row["severity"] = severity;
        rows.push_back(std::move(row));
      }
    }
    std::vector<Column> columns = system_columns();
    columns.insert(columns.begin(), {"/deadline_ms", "deadline, ms"});
    document["tables"].push_back(table(fmt::format("severity-{:g}", severity),
                                       fmt::format("Severity {:g}", severity),
                                       "The injected delays times the severity. Of the last "
                                       "deadline: " +
                                           describe(scenario),
                                       columns, rows));
  }
}

}  // namespace interneuron::cli::eval
