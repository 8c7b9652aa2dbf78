#include "lab/report/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace interneuron::report {
namespace {

using experiments::SystemRow;

// Per cent: a smaller difference rounds to nothing.
constexpr double kAsMuch = 0.5;

const SystemRow* find(const std::vector<SystemRow>& rows, const char* name) {
  const auto found = std::ranges::find(rows, name, &SystemRow::name);
  return found == rows.end() ? nullptr : &*found;
}

// What the application really got: AP with recordings, else the expected one.
double worth(const SystemRow& row) { return row.effective_ap.value_or(row.quality); }

// The baseline whose answers were worth most.
const SystemRow* best_baseline(const std::vector<SystemRow>& rows) {
  const SystemRow* best = nullptr;
  for (const SystemRow& row : rows) {
    if (row.baseline && (best == nullptr || worth(row) > worth(*best))) best = &row;
  }
  return best;
}

double percent(const SystemRow& row) { return 100 * row.timeouts_share; }

std::string what(const experiments::Document& document, const SystemRow& ours) {
  return fmt::format(
      "{} rounds of one camera frame each, each answered within 130 ms by a roadside unit over two "
      "links {}: Interneuron (“ours”) beside erdos_like, our reading of ERDOS, and further "
      "baselines, with the same frames, delays and run times.",
      ours.rounds,
      document.mode == "sim" ? "that were emulated in virtual time, with injected delays"
                             : "of the testbed, with injected delays");
}

std::string timeouts(const SystemRow& ours, const SystemRow& erdos) {
  const std::string who = fmt::format("Ours misses {:.1f} % of the rounds, erdos_like {:.1f} %",
                                      percent(ours), percent(erdos));
  if (erdos.timeouts == 0) return who + ".";
  const double fewer = 100 * (1 - ours.timeouts_share / erdos.timeouts_share);
  return fmt::format("{}: {:.0f} % {}.", who, std::abs(fewer), fewer >= 0 ? "fewer" : "more");
}

std::string answers(const std::vector<SystemRow>& rows, const SystemRow& ours) {
  const char* metric = ours.effective_ap ? "effective AP" : "quality (expected AP)";
  std::string out = fmt::format("Its answers have {} {:.3f}", metric, worth(ours));
  if (const SystemRow* best = best_baseline(rows)) {
    const double more = 100 * (worth(ours) / worth(*best) - 1);
    const std::string by =
        std::abs(more) < kAsMuch
            ? "as much as"
            : fmt::format("{:.0f} % {} than", std::abs(more), more >= 0 ? "more" : "less");
    out +=
        fmt::format(", {} those of the best baseline, {} ({:.3f})", by, best->name, worth(*best));
  }
  if (const SystemRow* oracle = find(rows, "oracle")) {
    out +=
        fmt::format("; an oracle that knows every delay beforehand reaches {:.3f}", worth(*oracle));
  }
  return out + ".";
}

}  // namespace

std::vector<std::string> headline(const experiments::Document& document) {
  const experiments::Table* table = find_table(document, "uniform");
  const auto* rows = table == nullptr ? nullptr : std::get_if<std::vector<SystemRow>>(&table->rows);
  if (rows == nullptr) return {};
  const SystemRow* ours = find(*rows, "ours");
  const SystemRow* erdos = find(*rows, "erdos_like");
  if (ours == nullptr || erdos == nullptr) return {};
  return {what(document, *ours), timeouts(*ours, *erdos), answers(*rows, *ours)};
}

}  // namespace interneuron::report
