// clock: the roadside's clock is wrong by an offset, drifts, or steps in the middle of a run. What
// is decided must not depend on it.
#include <fmt/format.h>

#include "lab/eval/experiments/compare.h"
#include "lab/eval/experiments/document.h"

namespace interneuron::experiments {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

struct ClockCase {
  const char* name;
  ClockFault kind;
  Duration offset{};
  std::int64_t drift_ppm = 0;
  Duration step{};
};
constexpr ClockCase kClockCases[] = {
    {"offset +1 h", ClockFault::kOffset, hours(1)},
    {"offset -1 h", ClockFault::kOffset, hours(-1)},
    {"offset +1 day", ClockFault::kOffset, hours(24)},
    {"offset -1 day", ClockFault::kOffset, hours(-24)},
    {"drift +200 ppm", ClockFault::kDrift, {}, 200},
    {"drift -200 ppm", ClockFault::kDrift, {}, -200},
    {"step +5 s", ClockFault::kStep, {}, 0, seconds(5)},
    {"step -5 s", ClockFault::kStep, {}, 0, seconds(-5)},
};
constexpr const char* kClockSystems[] = {"ours", "paper"};

eval::Scenario scenario_of(const ClockCase& c, std::uint32_t rounds) {
  eval::Scenario scenario = eval::table_erdos_scenario();
  scenario.road_clock = {c.offset, c.drift_ppm};
  if (c.step != Duration::zero()) scenario.clock_step = {{rounds / 2, c.step}};
  return scenario;
}

bool same_choices(const eval::Round& a, const eval::Round& b) {
  return a.plan == b.plan && a.variant == b.variant && a.level == b.level &&
         a.verdict.late == b.verdict.late &&
         a.verdict.released_at_deadline == b.verdict.released_at_deadline &&
         a.degraded_first == b.degraded_first && a.degraded_final == b.degraded_final &&
         a.recovering == b.recovering && a.on_time == b.on_time && a.shown == b.shown;
}

// X, overrun and time of the answer too, to the nanosecond.
bool same(const eval::Round& a, const eval::Round& b) {
  return same_choices(a, b) && a.verdict == b.verdict && a.x_permille == b.x_permille &&
         a.e2e == b.e2e;
}

struct Difference {
  std::uint64_t rounds = 0;
  // Rounds with another choice or outcome, and rounds that differ in anything.
  std::uint64_t choices = 0;
  std::uint64_t at_all = 0;
  std::uint64_t timeouts = 0;
  std::uint64_t reference_timeouts = 0;
  // The most rounds of one seed that only the wrong clock missed.
  std::uint64_t most_disturbed = 0;
};

Difference differ(const std::vector<eval::Run>& runs, const std::vector<eval::Run>& reference) {
  Difference d;
  for (std::size_t s = 0; s < runs.size(); ++s) {
    std::uint64_t disturbed = 0;
    for (std::size_t i = 0; i < runs[s].rounds.size(); ++i) {
      const eval::Round& a = runs[s].rounds[i];
      const eval::Round& b = reference[s].rounds[i];
      ++d.rounds;
      if (!same_choices(a, b)) ++d.choices;
      if (!same(a, b)) ++d.at_all;
      if (!a.on_time) ++d.timeouts;
      if (!b.on_time) ++d.reference_timeouts;
      if (!a.on_time && b.on_time) ++disturbed;
    }
    d.most_disturbed = std::max(d.most_disturbed, disturbed);
  }
  return d;
}

}  // namespace

void run_clock(const Request& request, Document& document) {
  const std::vector<eval::System> systems = some_systems(kClockSystems);
  const Compared reference =
      compare(request, "clock offset 0", eval::table_erdos_scenario(), systems, false);
  std::vector<ClockRow> rows;
  for (const ClockCase& c : kClockCases) {
    const Compared compared = compare(request, fmt::format("clock {}", c.name),
                                      scenario_of(c, request.rounds), systems, false);
    for (std::size_t i = 0; i < systems.size(); ++i) {
      const Difference d = differ(compared.runs[i], reference.runs[i]);
      rows.push_back({.name = c.name,
                      .kind = c.kind,
                      .system = systems[i].name,
                      .guard = std::string(to_string(systems[i].guard)),
                      .seeds = {request.first_seed, request.last_seed},
                      .rounds = d.rounds,
                      .decided_differently = d.choices,
                      .differ_at_all = d.at_all,
                      .timeouts = d.timeouts,
                      .timeouts_at_offset_0 = d.reference_timeouts,
                      .most_disturbed = d.most_disturbed});
    }
  }
  document.tables.push_back(
      {"clock",
       "The roadside's clock against the same run with offset 0",
       describe(eval::table_erdos_scenario()) +
           " A step comes in the middle of the run. Decided differently: plan, image, level, "
           "a sacrifice, or the answer; at all: overruns, X and times to the nanosecond, too.",
       {{"/name", "clock of the roadside"},
        {"/system", "system"},
        {"/rounds", "rounds"},
        {"/decided_differently", "decided differently"},
        {"/differ_at_all", "differ at all"},
        {"/timeouts", "timeouts"},
        {"/timeouts_at_offset_0", "at offset 0"},
        {"/most_disturbed", "most rounds lost in one seed"}},
       std::move(rows)});
}

}  // namespace interneuron::experiments
