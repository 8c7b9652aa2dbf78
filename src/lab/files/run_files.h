// What a run of rounds leaves behind: rounds.csv, summary.json (computed from the rows of the
// former and nothing else that it states per round), the table for people, and the plot of the
// end-to-end time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/pipeline.h"

namespace interneuron::cli {

// One round as the vehicle saw it; what the roadside saw of it came back with the result.
struct RoundRow {
  std::uint32_t round = 0;
  int frame = -1;
  std::string guard;  // "paper" or "budget"
  TimePoint t0{};
  bool answered = false;
  Outcome outcome = Outcome::kLocal;
  Duration e2e{};
  std::optional<std::uint32_t> age_rounds;
  std::int16_t x_permille = 0;
  bool recovering = false;
  bool degraded_final = false;  // D_{N-1} missed: the result was sent degraded
  std::size_t boxes = 0;
  // From the result; only of rounds on time.
  struct Road {
    int variant = 0;
    int level = 0;
    bool late = false;      // θ1 > D1
    bool released = false;  // the sampled image was used at exactly D1
    Duration overrun{};     // θ1 - D1 when late
    Duration compute{};
  };
  std::optional<Road> road;
  // Links that the frame was planned on: "raw:if5g sampled:if4g"; kRefusedPlan.
  std::string plan;
  std::optional<bool> possible;  // the clairvoyant best of the same links would have been on time
};

// The policy sent nothing although a link was up: the round was answered locally.
inline constexpr const char* kRefusedPlan = "refused";

struct LinkUse {
  std::string name;
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t resent_fragments = 0;
  std::uint64_t lost_packets = 0;
};

struct RunInfo {
  std::uint64_t seed = 0;
  bool seeded = false;  // false: real links, there is no seed
  Duration deadline{};
  Duration period{};
  std::string policy;
  std::string guard;   // "paper" or "budget"
  std::string ladder;  // what detects at the roadside, one line
  std::string backup;
  std::vector<std::string> level_names;
  std::vector<std::string> profiles;
  std::vector<LinkUse> links;
  std::optional<double> ap;  // with ground truth and a detector with models only
  std::optional<double> ar;
  std::optional<double> ap50;
  // Of the boxes that are drawn, the share that shows a person, and of the persons the share that
  // has such a box (IoU .50); known where ap is.
  std::optional<double> drawn_precision;
  std::optional<double> drawn_recall;
};

using Json = nlohmann::ordered_json;

Json summarise(const std::vector<RoundRow>& rows, const RunInfo& info);
// The summary as a table on stdout.
void print_table(const Json& summary);

// These throw Failure(1) naming the file.
void write_csv(const std::filesystem::path& file, const std::vector<RoundRow>& rows);
std::vector<RoundRow> read_csv(const std::filesystem::path& file);
void write_json(const std::filesystem::path& file, const Json& json);
Json read_json(const std::filesystem::path& file);
// Runs a script of gnuplot that writes `file`; false (and a line on stderr) when that is not
// installed.
bool draw(const std::filesystem::path& file, const std::string& gnuplot_script);
bool plot_latency(const std::filesystem::path& file, const std::vector<RoundRow>& rows,
                  const Json& summary);
void make_directory(const std::filesystem::path& directory);

}  // namespace interneuron::cli
