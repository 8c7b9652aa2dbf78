#include "lab/eval/experiments/compare.h"

#include <fmt/format.h>

#include <algorithm>

#include "lab/eval/experiments/document.h"

namespace interneuron::cli::eval {
namespace {

namespace core = interneuron::eval;

// A mean of zero rounds on time is no time at all.
Json time_or_null(const core::Figures& f, double ms) {
  return f.rounds > f.timeouts ? Json(ms) : Json(nullptr);
}

Json figures_json(const core::Figures& f, const core::Scenario& scenario) {
  Json row{{"rounds", f.rounds},
           {"timeouts", f.timeouts},
           {"timeouts_ci95", f.timeouts_ci95},
           {"timeouts_share", static_cast<double>(f.timeouts) / static_cast<double>(f.rounds)},
           {"consecutive", f.consecutive}};
  row["e2e_ms"] = {{"mean", time_or_null(f, f.e2e_mean_ms)},
                   {"p50", time_or_null(f, f.e2e_p50_ms)},
                   {"p95", time_or_null(f, f.e2e_p95_ms)},
                   {"p99", time_or_null(f, f.e2e_p99_ms)}};
  row["quality"] = f.quality;
  row["quality_on_time"] = time_or_null(f, f.quality_on_time);
  Json bytes = Json::object();
  double all = 0;
  for (std::size_t i = 0; i < f.bytes_per_round.size(); ++i) {
    bytes[scenario.links[i].name] = f.bytes_per_round[i];
    all += f.bytes_per_round[i];
  }
  row["bytes"] = {{"per_round", all}, {"kb_per_round", all / 1e3}, {"links", bytes}};
  return row;
}

Json ap_or_null(const std::optional<perception::Accuracy>& a) {
  return a ? Json(a->ap) : Json(nullptr);
}
Json ar_or_null(const std::optional<perception::Accuracy>& a) {
  return a ? Json(a->ar) : Json(nullptr);
}

void add_accuracy(Json& row, const Scorer& scorer, const std::vector<core::Run>& runs) {
  std::vector<ShownRound> every;
  std::vector<ShownRound> on_time;
  for (const core::Run& run : runs) {
    for (const core::Round& r : run.rounds) {
      every.push_back({r.round, r.shown});
      if (r.on_time) on_time.push_back({r.round, r.shown});
    }
  }
  const auto paper = on_time.empty() ? std::nullopt : scorer.score(on_time);
  const auto effective = scorer.score(every);
  row["ap"] = ap_or_null(paper);
  row["ar"] = ar_or_null(paper);
  row["effective_ap"] = ap_or_null(effective);
  row["effective_ar"] = ar_or_null(effective);
}

Json bound_row(const Request& request, const char* name, const char* about,
               const std::vector<core::Bound>& bounds) {
  std::uint64_t rounds = 0;
  std::uint64_t timeouts = 0;
  double quality = 0;
  std::vector<ShownRound> shown;
  std::vector<ShownRound> on_time;
  for (const core::Bound& bound : bounds) {
    timeouts += bound.timeouts;
    rounds += bound.shown.size();
    quality += bound.quality / static_cast<double>(bounds.size());
    for (std::uint32_t i = 0; i < bound.shown.size(); ++i) {
      shown.push_back({i, bound.shown[i]});
      if (bound.shown[i].kind == core::Shown::Kind::kRemote) on_time.push_back(shown.back());
    }
  }
  const auto paper = on_time.empty() ? std::nullopt : request.scorer.score(on_time);
  const auto effective = request.scorer.score(shown);
  return {{"name", name},
          {"about", about},
          {"guard", nullptr},
          {"policy", nullptr},
          {"baseline", false},
          {"seeds", {request.first_seed, request.last_seed}},
          {"rounds", rounds},
          {"timeouts", timeouts},
          {"timeouts_ci95", core::wilson95(timeouts, rounds)},
          {"timeouts_share", static_cast<double>(timeouts) / static_cast<double>(rounds)},
          {"consecutive", nullptr},
          {"e2e_ms", {{"mean", nullptr}, {"p50", nullptr}, {"p95", nullptr}, {"p99", nullptr}}},
          {"quality", quality},
          {"quality_on_time", nullptr},
          {"bytes", nullptr},
          {"ap", ap_or_null(paper)},
          {"ar", ar_or_null(paper)},
          {"effective_ap", ap_or_null(effective)},
          {"effective_ar", ar_or_null(effective)}};
}

}  // namespace

Compared compare(const Request& request, const std::string& what, const core::Scenario& scenario,
                 const std::vector<core::System>& systems, bool bounds) {
  Compared out{scenario, systems, {}, {}, {}};
  const std::size_t seeds = request.seeds();
  const auto seed_of = [&](std::size_t i) { return request.first_seed + i; };
  std::vector<core::Trace> traces;
  for (std::size_t i = 0; i < seeds; ++i) {
    traces.push_back(core::make_trace(scenario.law, seed_of(i), request.rounds));
  }
  out.runs.resize(systems.size(), std::vector<core::Run>(seeds));
  std::vector<std::optional<core::Bound>> causal(seeds);
  if (bounds) out.oracle.resize(seeds);
  // One further "system" for the bounds.
  request.progress.for_each(what, (systems.size() + (bounds ? 1 : 0)) * seeds, [&](std::size_t i) {
    const std::size_t system = i / seeds;
    const std::size_t s = i % seeds;
    if (system < systems.size()) {
      out.runs[system][s] = core::run(systems[system], scenario, traces[s], seed_of(s));
    } else {
      out.oracle[s] = core::oracle(scenario, traces[s], seed_of(s));
      causal[s] = core::causal(scenario, traces[s]);
    }
  });
  if (std::ranges::all_of(causal, [](const auto& c) { return c.has_value(); })) {
    for (auto& c : causal) out.causal.push_back(std::move(*c));
  }
  return out;
}

Json rows_of(const Request& request, const Compared& compared) {
  std::vector<Json> rows(compared.systems.size());
  request.progress.for_each("accuracies", rows.size(), [&](std::size_t i) {
    const core::System& system = compared.systems[i];
    rows[i] = {{"name", system.name},
               {"about", system.about},
               {"guard", to_string(system.guard)},
               {"policy", system.policy},
               {"baseline", system.is_baseline},
               {"seeds", {request.first_seed, request.last_seed}}};
    rows[i].update(figures_json(core::figures(compared.runs[i], compared.scenario.profile),
                                compared.scenario));
    add_accuracy(rows[i], request.scorer, compared.runs[i]);
  });
  Json bound;
  if (!compared.oracle.empty()) {
    rows.push_back(bound_row(request, "oracle", "knows every delay beforehand", compared.oracle));
    bound = {{"timeouts", rows.back()["timeouts"]},
             {"quality", rows.back()["quality"]},
             {"effective_ap", rows.back()["effective_ap"]}};
  }
  if (!compared.causal.empty()) {
    rows.push_back(bound_row(request, "causal", "knows the law and the past", compared.causal));
  }
  Json out = Json::array();
  for (Json& row : rows) {
    row["oracle"] = bound;
    out.push_back(std::move(row));
  }
  return out;
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

std::vector<core::System> all_systems(bool jpeg) {
  std::vector<core::System> out;
  for (const core::System& system : core::systems()) {
    if (jpeg || !system.needs_jpeg) out.push_back(system);
  }
  return out;
}

std::vector<core::System> some_systems(std::span<const char* const> names) {
  std::vector<core::System> out;
  for (const char* name : names) out.push_back(*core::find_system(name));
  return out;
}

std::string describe(const core::Scenario& scenario) {
  std::string out = fmt::format("Deadline {:.0f} ms, a frame every {:.0f} ms; links",
                                to_ms(scenario.deadline), to_ms(scenario.period));
  for (const emu::LinkProfile& link : scenario.links) out += " " + link.name;
  const core::DelayLaw& law = scenario.law;
  switch (law.shape) {
    case core::DelayLaw::Shape::kNone:
      out += "; no delay injected.";
      break;
    case core::DelayLaw::Shape::kUniform:
      out += fmt::format("; +U({:.0f}, {:.0f}) ms", to_ms(law.low), to_ms(law.high));
      break;
    case core::DelayLaw::Shape::kExponential:
      out += fmt::format("; +Exp({:.0f}) ms", to_ms(law.mean));
      break;
  }
  if (law.shape != core::DelayLaw::Shape::kNone) {
    out += fmt::format(" in one module of {:.0f} % of the rounds, in bursts of {:.0f} on average.",
                       100 * law.share, law.burst);
  }
  out += " Frame:";
  for (const core::VariantProfile& v : scenario.profile.variants) {
    out += fmt::format(" {} {:.0f} KB", v.name, static_cast<double>(v.bytes) / 1024);
  }
  return out + ".";
}

}  // namespace interneuron::cli::eval
