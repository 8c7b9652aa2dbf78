#include "app/load_testbed/series.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>

#include "app/load_testbed/run.h"
#include "host/process/failure.h"
#include "host/process/status_line.h"

namespace interneuron::cli {
namespace {

using load::Scenario;

// Those that this machine can run; says once why others are left out.
std::vector<Scenario> able(const std::vector<Scenario>& scenarios) {
  std::vector<Scenario> out;
  std::set<std::string> said;
  for (const Scenario& s : scenarios) {
    auto reason = lacks(s.peer);
    if (!reason) reason = cannot_play(s);
    if (!reason) {
      out.push_back(s);
    } else if (said.insert(*reason).second) {
      fmt::print(stderr, "interneuron: left out: {}\n", *reason);
    }
  }
  return out;
}

std::string name_of(const Scenario& s) {
  return fmt::format("{} {}, {}, load {:.3g}", s.group, s.name, load::name_of(s.peer), s.load);
}

// On a terminal a line that is written again and again, else a line for each run.
void tell(StatusLine& line, const std::vector<Scenario>& scenarios, std::size_t index) {
  Duration left{};
  for (std::size_t i = index; i < scenarios.size(); ++i) left += time_of_run(scenarios[i]);
  const std::string text =
      fmt::format("bench load: run {} of {}: {}, {:.0f} s left", index + 1, scenarios.size(),
                  name_of(scenarios[index]), to_ms(left) / 1e3);
  if (line.live()) {
    line.show(text);
  } else {
    fmt::print(stderr, "{}\n", text);
  }
}

}  // namespace

std::vector<load::Row> run_series(const std::vector<Scenario>& scenarios) {
  const std::vector<Scenario> list = able(scenarios);
  if (list.empty()) throw Failure(kCannotHere, "nothing of this can be run on the testbed here");
  const std::filesystem::path scratch =
      std::filesystem::temp_directory_path() / fmt::format("interneuron-load-{}", ::getpid());
  StatusLine line;
  std::vector<load::Row> out;
  for (std::size_t i = 0; i < list.size(); ++i) {
    tell(line, list, i);
    TestbedRow run = run_on_testbed(list[i], scratch);
    if (!run.doubt.empty()) {
      line.clear();
      fmt::print(stderr, "interneuron: doubtful: {}: {}\n", name_of(list[i]), run.doubt);
    }
    out.push_back(std::move(run.row));
  }
  line.clear();
  return out;
}

}  // namespace interneuron::cli
