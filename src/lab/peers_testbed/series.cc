#include "lab/peers_testbed/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "lab/transports/play.h"
#include "lab/transports/series_line.h"

namespace interneuron::peers_testbed {
namespace {

std::string name_of(const Run& run) {
  std::string out =
      fmt::format("{}, {} bytes, {}", run.scenario->name, run.message_bytes, run.peer->name);
  if (run.peer->heeds_deadline) out += fmt::format(", {:.0f} ms", to_ms(run.deadlines.front()));
  return out;
}

// The peers of these runs that this machine lacks.
std::vector<Skipped> skipped_of(const std::vector<Run>& runs) {
  std::vector<Skipped> out;
  for (const Run& run : runs) {
    if (std::ranges::find(out, run.peer->name, &Skipped::peer) != out.end()) continue;
    if (const auto reason = transports::lacks(transport_of(run))) {
      out.push_back({std::string(run.peer->name), *reason});
    }
  }
  return out;
}

}  // namespace

Compared compare(const std::vector<Run>& runs) {
  Compared out{{}, skipped_of(runs), {}};
  for (const Skipped& s : out.skipped) {
    fmt::print(stderr, "interneuron: left out: {}: {}\n", s.peer, s.reason);
  }
  std::vector<Run> list = runs;
  std::erase_if(list, [&out](const Run& run) {
    return std::ranges::find(out.skipped, run.peer->name, &Skipped::peer) != out.skipped.end();
  });
  if (list.empty()) {
    throw process::Failure(process::kCannotHere, "none of these peers can be run on this machine");
  }
  std::vector<Duration> times;
  for (const Run& run : list) times.push_back(time_of_run(run));
  const process::PrivateFolder folder("interneuron-peers");
  const std::filesystem::path scratch = folder / "run";
  transports::SeriesLine line("bench peers", std::move(times));
  for (const Run& run : list) {
    line.next(name_of(run));
    try {
      const Ran ran = play_run(run, scratch);
      line.doubt(ran.doubt);
      out.rows.insert(out.rows.end(), ran.rows.begin(), ran.rows.end());
    } catch (...) {
      if (out.rows.empty()) throw;
      out.ended = std::current_exception();
      break;
    }
  }
  return out;
}

}  // namespace interneuron::peers_testbed
