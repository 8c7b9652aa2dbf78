#include "lab/eval/experiments/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace interneuron::experiments {
namespace {

// A mean of zero rounds on time is no time at all.
std::optional<double> known(const eval::Figures& f, double value) {
  return f.rounds > f.timeouts ? std::optional(value) : std::nullopt;
}

void add_figures(SystemRow& row, const eval::Figures& f, const eval::Scenario& scenario) {
  row.rounds = f.rounds;
  row.timeouts = f.timeouts;
  row.timeouts_ci95 = f.timeouts_ci95;
  row.timeouts_share = static_cast<double>(f.timeouts) / static_cast<double>(f.rounds);
  row.consecutive = f.consecutive;
  row.e2e_ms = {known(f, f.e2e_mean_ms), known(f, f.e2e_p50_ms), known(f, f.e2e_p95_ms),
                known(f, f.e2e_p99_ms)};
  row.quality = f.quality;
  row.quality_on_time = known(f, f.quality_on_time);
  Traffic& bytes = row.bytes.emplace();
  for (std::size_t i = 0; i < f.bytes_per_round.size(); ++i) {
    bytes.links.emplace_back(scenario.links[i].name, f.bytes_per_round[i]);
    bytes.per_round += f.bytes_per_round[i];
  }
  bytes.kb_per_round = bytes.per_round / 1e3;
}

void add_accuracy(SystemRow& row, const Scorer& scorer, const std::vector<ShownRound>& every,
                  const std::vector<ShownRound>& on_time) {
  if (const auto paper = on_time.empty() ? std::nullopt : scorer.score(on_time)) {
    row.ap = paper->ap;
    row.ar = paper->ar;
  }
  if (const auto effective = scorer.score(every)) {
    row.effective_ap = effective->ap;
    row.effective_ar = effective->ar;
  }
}

SystemRow row_of(const Request& request, const Compared& compared, std::size_t i,
                 const Scoring& score) {
  const eval::System& system = compared.systems[i];
  SystemRow row;
  row.name = system.name;
  row.about = system.about;
  row.guard = std::string(to_string(system.guard));
  row.policy = system.policy;
  row.baseline = system.is_baseline;
  row.seeds = {request.first_seed, request.last_seed};
  const std::vector<eval::Run>& runs = compared.runs[i];
  add_figures(row, eval::figures(runs, compared.scenario.profile), compared.scenario);
  std::vector<ShownRound> every;
  std::vector<ShownRound> on_time;
  for (const eval::Run& run : runs) {
    for (const eval::Round& r : run.rounds) {
      every.push_back({r.round, r.shown});
      if (r.on_time) on_time.push_back({r.round, r.shown});
    }
  }
  score(row, every, on_time);
  return row;
}

SystemRow bound_row(const Request& request, const char* name, const char* about,
                    const std::vector<eval::Bound>& bounds, const Scoring& score) {
  SystemRow row;
  row.name = name;
  row.about = about;
  row.seeds = {request.first_seed, request.last_seed};
  std::vector<ShownRound> shown;
  std::vector<ShownRound> on_time;
  for (const eval::Bound& bound : bounds) {
    row.timeouts += bound.timeouts;
    row.rounds += bound.shown.size();
    row.quality += bound.quality / static_cast<double>(bounds.size());
    for (std::uint32_t i = 0; i < bound.shown.size(); ++i) {
      shown.push_back({i, bound.shown[i]});
      if (bound.shown[i].kind == eval::Shown::Kind::kRemote) on_time.push_back(shown.back());
    }
  }
  row.timeouts_ci95 = eval::wilson95(row.timeouts, row.rounds);
  row.timeouts_share = static_cast<double>(row.timeouts) / static_cast<double>(row.rounds);
  score(row, shown, on_time);
  return row;
}

}  // namespace

Compared compare(const Request& request, const std::string& what, eval::Scenario scenario,
                 const std::vector<eval::System>& systems, bool bounds) {
  scenario.is_encrypted = request.is_encrypted;
  Compared out{scenario, systems, {}, {}, {}};
  const std::size_t seeds = request.seeds();
  const auto seed_of = [&](std::size_t i) { return request.first_seed + i; };
  std::vector<eval::Trace> traces;
  for (std::size_t i = 0; i < seeds; ++i) {
    traces.push_back(eval::make_trace(scenario.law, seed_of(i), request.rounds));
  }
  out.runs.resize(systems.size(), std::vector<eval::Run>(seeds));
  std::vector<std::optional<eval::Bound>> causal(seeds);
  if (bounds) out.oracle.resize(seeds);
  // One further "system" for the bounds.
  request.progress.for_each(what, (systems.size() + (bounds ? 1 : 0)) * seeds, [&](std::size_t i) {
    const std::size_t system = i / seeds;
    const std::size_t s = i % seeds;
    if (system < systems.size()) {
      out.runs[system][s] = eval::run(systems[system], scenario, traces[s], seed_of(s));
    } else {
      out.oracle[s] = eval::oracle(scenario, traces[s], seed_of(s));
      causal[s] = eval::causal(scenario, traces[s]);
    }
  });
  if (std::ranges::all_of(causal, [](const auto& c) { return c.has_value(); })) {
    for (auto& c : causal) out.causal.push_back(std::move(*c));
  }
  return out;
}

std::vector<SystemRow> system_rows(const Request& request, const Compared& compared) {
  return system_rows(
      request, compared,
      [&scorer = request.scorer](SystemRow& row, const auto& every, const auto& on_time) {
        add_accuracy(row, scorer, every, on_time);
      });
}

std::vector<SystemRow> system_rows(const Request& request, const Compared& compared,
                                   const Scoring& score) {
  std::vector<SystemRow> rows(compared.systems.size());
  request.progress.for_each("scores", rows.size(),
                            [&](std::size_t i) { rows[i] = row_of(request, compared, i, score); });
  std::optional<OracleFigures> oracle;
  if (!compared.oracle.empty()) {
    rows.push_back(bound_row(request, "oracle",
                             "knows every delay beforehand; without striping, without carry-over",
                             compared.oracle, score));
    oracle = {rows.back().timeouts, rows.back().quality, rows.back().effective_ap};
  }
  if (!compared.causal.empty()) {
    rows.push_back(bound_row(request, "causal",
                             "knows the law and the past; without striping, without carry-over",
                             compared.causal, score));
  }
  for (SystemRow& row : rows) row.oracle = oracle;
  return rows;
}

std::vector<Column> system_columns() {
  return {{"/name", "system"},
          {"/rounds", "rounds"},
          {"/timeouts", "timeouts"},
          {"/timeouts_share", "%", 2, true},
          {"/timeouts_ci95", "95 % interval, %", 2, true},
          {"/consecutive", "in a row"},
          {"/e2e_ms/mean", "e2e mean, ms", 1},
          {"/e2e_ms/p50", "p50", 1},
          {"/e2e_ms/p95", "p95", 1},
          {"/e2e_ms/p99", "p99", 1},
          {"/ap", "AP", 3},
          {"/ar", "AR", 3},
          {"/effective_ap", "effective AP", 3},
          {"/quality", "quality", 4},
          {"/bytes/kb_per_round", "kB/round", 0}};
}

std::vector<eval::System> all_systems(const eval::Scenario& scenario, bool jpeg) {
  const bool has_player = eval::is_known_to_causal(scenario);
  std::vector<eval::System> out;
  for (const eval::System& system : eval::systems()) {
    if (system.needs_jpeg && !jpeg) continue;
    if (system.is_bound() && !has_player) continue;
    out.push_back(system);
  }
  return out;
}

std::vector<eval::System> some_systems(std::span<const char* const> names) {
  std::vector<eval::System> out;
  for (const char* name : names) out.push_back(*eval::find_system(name));
  return out;
}

std::string describe(const eval::Scenario& scenario) {
  std::string out = fmt::format("Deadline {:.0f} ms, a frame every {:.0f} ms; links",
                                to_ms(scenario.deadline), to_ms(scenario.period));
  for (const emu::LinkProfile& link : scenario.links) out += " " + link.name;
  const eval::DelayLaw& law = scenario.law;
  switch (law.shape) {
    case eval::DelayLaw::Shape::kNone:
      out += "; no delay injected.";
      break;
    case eval::DelayLaw::Shape::kUniform:
      out += fmt::format("; +U({:.0f}, {:.0f}) ms", to_ms(law.low), to_ms(law.high));
      break;
    case eval::DelayLaw::Shape::kExponential:
      out += fmt::format("; +Exp({:.0f}) ms", to_ms(law.mean));
      break;
  }
  if (law.shape != eval::DelayLaw::Shape::kNone) {
    out += fmt::format(" in one module of {:.0f} % of the rounds, in bursts of {:.2g} on average",
                       100 * law.share, law.burst);
    if (law.modules != eval::DelayLaw{}.modules) {
      const double all = std::accumulate(law.modules.begin(), law.modules.end(), 0.0);
      for (std::size_t i = 0; i < law.modules.size(); ++i) {
        if (law.modules[i] <= 0) continue;
        const auto module = static_cast<eval::Module>(i);
        const bool of_one = module == eval::Module::kUplink && law.uplink_of;
        out +=
            fmt::format("; {:.0f} % {}{}{}", 100 * law.modules[i] / all, eval::to_string(module),
                        of_one ? " of " : "", of_one ? scenario.links.at(*law.uplink_of).name : "");
      }
    }
    out += '.';
  }
  out += " Frame:";
  for (const eval::VariantProfile& v : scenario.profile.variants) {
    out += fmt::format(" {} {:.0f} KB", v.name, static_cast<double>(v.bytes) / 1024);
  }
  return out + ".";
}

}  // namespace interneuron::experiments
