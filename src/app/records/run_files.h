// What a run of rounds leaves behind: rounds.csv, summary.json (computed from the rows of the
// former and nothing else that it states per round), the table for people, and the plot of the
// end-to-end time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/process/whole_file.h"
#include "app/records/json_file.h"
#include "interneuron/pipeline.h"

namespace interneuron::records {

// One round as the vehicle saw it; what the roadside saw of it came back with the result.
struct RoundRow {
  std::uint32_t round = 0;
  int frame = -1;
  // "paper" or "budget".
  std::string guard;
  TimePoint t0{};
  bool answered = false;
  Outcome outcome = Outcome::kLocal;
  Duration e2e{};
  std::optional<std::uint32_t> age_rounds;
  std::int16_t x_permille = 0;
  bool recovering = false;
  // D_{N-1} was missed, so the result was sent degraded.
  bool degraded_final = false;
  std::size_t boxes = 0;
  // What the result told of the roadside; only rounds on time have it.
  struct Road {
    // The name of the image that was computed on, "raw" or "jpeg-half" for example.
    std::string variant;
    int level = 0;
    // θ1 > D1.
    bool late = false;
    // A smaller image was used at exactly D1.
    bool released = false;
    // θ1 - D1 when late.
    Duration overrun{};
    Duration compute{};
  };
  std::optional<Road> road;
  // The links that the frame was planned on, as "raw:if5g sampled:if4g", or kRefusedPlan.
  std::string plan;
  // Whether a policy that knows the delays of the same links would have been on time.
  std::optional<bool> possible;
};

// The policy sent nothing although a link was up: the round was answered locally.
inline constexpr const char* kRefusedPlan = "refused";

struct LinkUse {
  std::string name;
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t resent_fragments = 0;
  std::uint64_t sent_symbols = 0;
  std::uint64_t lost_packets = 0;
};

struct RunInfo {
  std::uint64_t seed = 0;
  // Real links have no seed.
  bool seeded = false;
  Duration deadline{};
  Duration period{};
  std::string policy;
  // Which images were offered to it: "paper" or "jpeg".
  std::string images;
  // "paper" or "budget".
  std::string guard;
  // What detects at the roadside, in one line.
  std::string ladder;
  std::string backup;
  std::vector<std::string> level_names;
  std::vector<std::string> profiles;
  std::vector<LinkUse> links;
  // Known with ground truth and a detector with models alone.
  std::optional<double> ap;
  std::optional<double> ar;
  std::optional<double> ap50;
  // Of the boxes that are drawn, the share that shows a person, and of the persons the share that
  // has such a box (IoU .50); known where ap is.
  std::optional<double> drawn_precision;
  std::optional<double> drawn_recall;
};

Json summarise(const std::vector<RoundRow>& rows, const RunInfo& info);
// The summary as a table on stdout.
void print_table(const Json& summary);

// These throw process::Failure (1) that names the file.
// A rounds.csv that grows by a line at a time and appears whole, when it is committed, or not at
// all.
class CsvFile {
 public:
  explicit CsvFile(const std::filesystem::path& file);
  void add(const RoundRow& row);
  void commit() { out_.commit(); }

 private:
  process::WholeFile out_;
};
void write_csv(const std::filesystem::path& file, const std::vector<RoundRow>& rows);
std::vector<RoundRow> read_csv(const std::filesystem::path& file);
// The end-to-end time of rounds in a row, which may be the newest of more. False (and a line on
// stderr) when gnuplot is not installed.
bool plot_latency(const std::filesystem::path& file, const std::vector<RoundRow>& rows,
                  const Json& summary);
void make_directory(const std::filesystem::path& directory);

}  // namespace interneuron::records
