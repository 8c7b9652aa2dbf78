#include "lab/bench/command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "app/process/failure.h"
#include "app/process/progress.h"
#include "app/process/signals.h"
#include "app/records/json_file.h"
#include "interneuron/policy.h"
#include "lab/coding/series.h"

namespace interneuron::bench {
namespace {

using coding::Row;
using coding::Series;

constexpr const char* kCodingSchema = "interneuron.coding/1";
constexpr std::size_t kMostMessages = 1'000'000;

struct CodingOptions {
  std::vector<std::string> series;
  std::vector<std::string> policies;
  // 0: as many as the series says.
  std::size_t messages = 0;
  std::uint64_t seed = 1;
  bool json = false;
};

struct CodingTask {
  const Series* series = nullptr;
  std::string policy;
  Row row;
};

std::vector<std::string> series_names() {
  std::vector<std::string> out;
  for (const Series& s : coding::all_series()) out.emplace_back(s.name);
  return out;
}

std::vector<std::string> policy_names() {
  std::vector<std::string> out;
  for (const auto& policy : builtin_policies()) out.emplace_back(policy->name());
  return out;
}

std::vector<CodingTask> tasks_of(const CodingOptions& o) {
  std::vector<CodingTask> tasks;
  for (const Series& s : coding::all_series()) {
    const bool chosen = o.series.empty() || std::ranges::find(o.series, s.name) != o.series.end();
    if (!chosen) continue;
    if (o.policies.empty()) tasks.push_back({&s, std::string(s.policy), {}});
    for (const std::string& policy : o.policies) tasks.push_back({&s, policy, {}});
  }
  return tasks;
}

records::Json json_of(const std::vector<CodingTask>& tasks, std::uint64_t seed) {
  records::Json out{{"schema", kCodingSchema}, {"seed", seed}, {"rows", records::Json::array()}};
  for (const CodingTask& t : tasks) {
    out["rows"].push_back({{"scenario", t.series->name},
                           {"policy", t.policy},
                           {"messages", t.row.messages},
                           {"missed", t.row.missed},
                           {"degraded", t.row.degraded},
                           {"most_degraded", t.row.most_degraded},
                           {"wire_ratio", std::round(t.row.wire_ratio * 10000) / 10000}});
  }
  return out;
}

void print_table(const std::vector<CodingTask>& tasks) {
  const Series* series = nullptr;
  for (const CodingTask& t : tasks) {
    if (t.series != series) {
      series = t.series;
      fmt::print("\n{}: {}; {} bytes every {:.0f} ms, deadline {:.0f} ms\n", series->name,
                 series->about, series->variants.front(), to_ms(series->period),
                 to_ms(series->deadline));
      fmt::print("{:16}{:>10}{:>8}{:>9}{:>10}{:>8}\n", "policy", "messages", "missed", "%",
                 "degraded", "wire");
    }
    const double share =
        100.0 * static_cast<double>(t.row.missed) / static_cast<double>(t.row.messages);
    fmt::print("{:16}{:>10}{:>8}{:>9.3f}{:>10}{:>8.3f}\n", t.policy, t.row.messages, t.row.missed,
               share, t.row.degraded, t.row.wire_ratio);
    if (series->phases > 1) {
      fmt::print("  at most {} degraded in one phase\n", t.row.most_degraded);
    }
  }
  fmt::print(
      "\nMissed: without any variant by the deadline. Wire: IP bytes that left the vehicle over "
      "those of whole messages.\n");
}

int run_coding(const CodingOptions& o) {
  const process::SignalWatch signals;
  std::vector<CodingTask> tasks = tasks_of(o);
  process::Progress progress;
  progress.for_each("bench coding", tasks.size(), [&](std::size_t i) {
    const std::size_t messages = o.messages > 0 ? o.messages : tasks[i].series->messages;
    tasks[i].row = coding::run(*tasks[i].series, tasks[i].policy, messages, o.seed);
  });
  if (o.json) {
    fmt::print("{}\n", json_of(tasks, o.seed).dump(2));
  } else {
    print_table(tasks);
  }
  return process::kFine;
}

}  // namespace

void add_coding(CLI::App& bench, std::function<int()>& run) {
  auto o = std::make_shared<CodingOptions>();
  CLI::App* c = bench.add_subcommand(
      "coding", "What symbols, shares and shadows save and cost, in virtual time");
  c->add_option("NAME", o->series, "What is run (default: everything)")
      ->check(CLI::IsMember(series_names()));
  c->add_option("--policy", o->policies,
                "Once per policy, or with commas (default: the one that each is for)")
      ->delimiter(',')
      ->take_all()
      ->allow_extra_args(false)
      ->check(CLI::IsMember(policy_names()));
  c->add_option("--messages", o->messages, "How many (default: 2000; of each phase of hole: 100)")
      ->check(CLI::Range(std::size_t{1}, kMostMessages));
  c->add_option("--seed", o->seed, "Seed of the links")->capture_default_str();
  c->add_flag("--json", o->json, "The rows as JSON on stdout (docs/schema/coding.json)");
  std::string footer = "Names:\n";
  for (const Series& s : coding::all_series()) {
    footer += fmt::format("  {:8} {}\n", s.name, s.about);
  }
  c->footer(footer +
            "Examples:\n  interneuron bench coding\n"
            "  interneuron bench coding losses --policy best_link,duplicate,coded --messages "
            "20000\n  interneuron bench coding hole --json");
  c->callback([&run, o] { run = [o] { return run_coding(*o); }; });
}

}  // namespace interneuron::bench
