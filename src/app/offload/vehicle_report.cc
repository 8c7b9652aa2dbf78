#include "app/offload/vehicle_run.h"

#include <cstdio>

#include "app/records/run_files.h"
#include "app/records/verdict.h"
#include "app/settings/data.h"

namespace interneuron::offload {
namespace {

records::RunInfo info_of(const VehicleOptions& options, const VehicleRun& run,
                         const Statistics& statistics) {
  records::RunInfo info;
  info.seeded = options.seed >= 0;
  if (info.seeded) info.seed = static_cast<std::uint64_t>(options.seed);
  info.deadline = from_ms(options.deadline_ms);
  info.period = from_ms(options.period_ms);
  const auto images = perception::parse_images(options.images);
  info.policy = options.policy.empty() ? default_policy(*images) : options.policy;
  info.images = options.images;
  info.guard = options.guard;
  info.backup = run.backup;
  info.profiles = options.profiles;
  for (const Statistics::Link& link : statistics.links) {
    const LinkCounters& c = link.counters;
    info.links.push_back({link.nic, c.sent_bytes, c.received_bytes, c.fragments_resent,
                          c.symbols_sent, c.fragments_lost});
  }
  return info;
}

}  // namespace

std::string default_policy(perception::Images images) {
  return images == perception::Images::kJpeg ? "joint" : "down_sampling";
}

std::optional<std::filesystem::path> truth_of(const VehicleOptions& options,
                                              const std::optional<std::filesystem::path>& data,
                                              const std::string& video) {
  if (options.truth == "none") return std::nullopt;
  if (!options.truth.empty()) return options.truth;
  const bool demo_video = data && video == (*data / "pets/vtest.avi").string();
  return demo_video ? settings::default_truth(data) : std::nullopt;
}

void show_progress(process::StatusLine& line, const RunRecord::Counts& counts, std::uint32_t rounds,
                   bool last) {
  if (!line.live() && !last && counts.decided % 50 >= 5) return;
  const std::string text = "vehicle: round " + std::to_string(counts.begun) +
                           (rounds > 0 ? " of " + std::to_string(rounds) : "") + ": " +
                           std::to_string(counts.on_time) + " on time, " +
                           std::to_string(counts.decided - counts.on_time) + " answered locally";
  line.show(text);
  if (last) line.keep();
  if (!line.live()) std::fprintf(stderr, "%s\n", text.c_str());
}

int report_run(const VehicleOptions& options, const VehicleRun& run, RunRecord& record,
               const Statistics& statistics) {
  records::RunInfo info = info_of(options, run, statistics);
  record.close();
  if (const auto file = truth_of(options, run.data, run.video)) record.compare(*file, info);
  const records::Json summary = record.write(info);
  if (options.json) {
    std::printf("%s\n", summary.dump(2).c_str());
  } else if (options.table && !options.quiet) {
    records::print_table(summary);
    std::printf("\n%s\n", records::verdict(summary).c_str());
  }
  return records::judge_objective(summary, options.objective);
}

}  // namespace interneuron::offload
