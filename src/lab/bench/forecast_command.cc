#include "lab/bench/command.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "app/process/failure.h"
#include "app/process/progress.h"
#include "app/process/signals.h"
#include "lab/bench/reports.h"
#include "lab/load/forecast.h"

namespace interneuron::bench {
namespace {

// Seeds: wide, it catches slips of pen.
constexpr std::uint64_t kMostSeeds = 10'000;

struct ForecastOptions {
  std::vector<std::string> names;
  // Not those that the law was fitted on, 1 and 2, of refused messages 1 to 4
  // (src/core/messages/on_time_forecast.cc).
  std::uint64_t first_seed = 101;
  std::uint64_t seeds = 1;
  bool json = false;
  std::string plot;
};

struct ForecastTask {
  load::ForecastScenario scenario;
  std::vector<load::Forecast> forecasts;
};

std::vector<ForecastTask> tasks_of(const ForecastOptions& o) {
  std::vector<ForecastTask> out;
  for (const std::string& name : o.names.empty() ? load::forecast_names() : o.names) {
    for (std::uint64_t i = 0; i < o.seeds; ++i) {
      for (load::ForecastScenario& s : load::forecast_scenarios(name, o.first_seed + i)) {
        out.push_back({std::move(s), {}});
      }
    }
  }
  return out;
}

// The forecasts of those tasks that `is_part` says, in bins. Seconds of different runs are
// different seconds.
template <class IsPart>
Judged judged(const std::string& name, const std::vector<ForecastTask>& tasks,
              const IsPart& is_part) {
  constexpr std::uint64_t kSecondsOfARun = 1'000'000;
  std::vector<load::Forecast> part;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    for (load::Forecast f : tasks[i].forecasts) {
      // The second run, of refused messages, is one of its own.
      f.second += kSecondsOfARun * (2 * i + (f.refused ? 1 : 0));
      if (is_part(tasks[i].scenario, f)) part.push_back(f);
    }
  }
  return {name, load::calibration(part), load::brier_score(part), part.size()};
}

std::vector<Judged> judge(const std::vector<ForecastTask>& tasks) {
  using load::Forecast;
  using load::ForecastScenario;
  std::vector<Judged> out;
  out.push_back(judged("all loads", tasks, [](const ForecastScenario& s, const Forecast&) {
    return s.profiles.empty();
  }));
  out.push_back(judged("all drives", tasks, [](const ForecastScenario& s, const Forecast&) {
    return !s.profiles.empty();
  }));
  out.push_back(judged("refused", tasks,
                       [](const ForecastScenario&, const Forecast& f) { return f.refused; }));
  for (const std::string& name : load::forecast_names()) {
    out.push_back(judged(name, tasks, [&name](const ForecastScenario& s, const Forecast&) {
      return s.name == name;
    }));
  }
  std::erase_if(out, [](const Judged& j) { return j.bins.empty(); });
  return out;
}

int run_forecast(const ForecastOptions& o) {
  require_picture(o.plot);
  const process::SignalWatch signals;
  std::vector<ForecastTask> tasks = tasks_of(o);
  process::Progress progress;
  progress.for_each("bench forecast", tasks.size(), [&](std::size_t i) {
    tasks[i].forecasts = load::forecasts(tasks[i].scenario);
  });
  const std::vector<Judged> all = judge(tasks);
  if (o.json) {
    fmt::print("{}\n", forecast_json(all, o.first_seed, o.seeds).dump(2));
  } else {
    print_forecast(all);
  }
  if (!o.plot.empty()) plot_forecast(o.plot, all);
  if (!o.plot.empty() && !o.json) fmt::print("\nwritten to {}\n", o.plot);
  return process::kFine;
}

}  // namespace

void add_forecast(CLI::App& bench, std::function<int()>& run) {
  auto o = std::make_shared<ForecastOptions>();
  CLI::App* c = bench.add_subcommand(
      "forecast", "Whether the chances that send() predicts are kept, in virtual time");
  c->add_option("NAME", o->names, "What is run (default: everything)")
      ->check(CLI::IsMember(load::forecast_names()));
  c->add_option("--seed", o->first_seed, "The first seed")->capture_default_str();
  c->add_option("--seeds", o->seeds, "How many seeds, each run once")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, kMostSeeds));
  c->add_flag("--json", o->json, "The bins as JSON on stdout (docs/schema/forecast.json)");
  c->add_option("--plot", o->plot, "Draws what happened against what was predicted, .svg or .png");
  std::string footer = "Names:\n ";
  for (const std::string& name : load::forecast_names()) footer += " " + name;
  c->footer(footer +
            "\nExamples:\n  interneuron bench forecast rate 4g --seeds 4\n"
            "  interneuron bench forecast --json");
  c->callback([&run, o] { run = [o] { return run_forecast(*o); }; });
}

}  // namespace interneuron::bench
