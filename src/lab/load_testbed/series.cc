#include "lab/load_testbed/run.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <set>

#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "lab/transports/series_line.h"

namespace interneuron::load_testbed {
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

}  // namespace

std::vector<load::Row> run_series(const std::vector<Scenario>& scenarios, TransportKind datagrams) {
  const std::vector<Scenario> list = able(scenarios);
  if (list.empty())
    throw process::Failure(process::kCannotHere, "nothing of this can be run on the testbed here");
  const process::PrivateFolder folder("interneuron-load");
  const std::filesystem::path scratch = folder / "run";
  std::vector<Duration> times;
  for (const Scenario& s : list) times.push_back(time_of_run(s));
  transports::SeriesLine line("bench load", std::move(times));
  std::vector<load::Row> out;
  for (const Scenario& s : list) {
    line.next(name_of(s));
    TestbedRow run = run_on_testbed(s, datagrams, scratch);
    line.doubt(run.doubt);
    out.push_back(std::move(run.row));
  }
  return out;
}

}  // namespace interneuron::load_testbed
