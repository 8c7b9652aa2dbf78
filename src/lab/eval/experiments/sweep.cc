// sweep: the deadline from tight to loose, and the injected delays from none to twice the law's.
#include <fmt/format.h>

#include "lab/eval/experiments/compare.h"
#include "lab/eval/experiments/document.h"

namespace interneuron::experiments {
namespace {

constexpr int kDeadlinesMs[] = {60, 80, 100, 130, 160, 200};
constexpr double kSeverities[] = {0, 0.5, 1, 2};
constexpr const char* kSystems[] = {"ours", "paper", "erdos_like", "erdos_e2e", "duplicate_e2e"};

Duration scaled(Duration d, double by) {
  return Duration{static_cast<std::int64_t>(static_cast<double>(d.count()) * by)};
}

}  // namespace

void run_sweep(const Request& request, Document& document) {
  const std::vector<eval::System> systems = some_systems(kSystems);
  for (const double severity : kSeverities) {
    std::vector<SystemRow> rows;
    eval::Scenario scenario = eval::table_erdos_scenario();
    scenario.law.low = scaled(scenario.law.low, severity);
    scenario.law.high = scaled(scenario.law.high, severity);
    if (severity == 0) scenario.law.shape = eval::DelayLaw::Shape::kNone;
    for (const int deadline : kDeadlinesMs) {
      scenario.deadline = std::chrono::milliseconds(deadline);
      const Compared compared =
          compare(request, fmt::format("sweep {} ms, severity {:g}", deadline, severity), scenario,
                  systems);
      for (SystemRow& row : system_rows(request, compared)) {
        row.sweep = {deadline, severity};
        rows.push_back(std::move(row));
      }
    }
    std::vector<Column> columns = system_columns();
    columns.insert(columns.begin(), {"/deadline_ms", "deadline, ms"});
    document.tables.push_back({fmt::format("severity-{:g}", severity),
                               fmt::format("Severity {:g}", severity),
                               "The injected delays times the severity. Of the last "
                               "deadline: " +
                                   describe(scenario),
                               std::move(columns), std::move(rows)});
  }
}

}  // namespace interneuron::experiments
