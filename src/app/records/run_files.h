// What a run of rounds leaves behind: rounds.csv, summary.json (computed from the rows of the
// former and nothing else that it states per round), the table for people, and the plot of the
// end-to-end time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <random>
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
  // The share of the boxes that are drawn which shows a person, and the share of the persons that
  // has such a box (IoU .50); known where ap is.
  std::optional<double> drawn_precision;
  std::optional<double> drawn_recall;
};

Json summarise(const std::vector<RoundRow>& rows, const RunInfo& info);
// The summary as a table on stdout.
void print_table(const Json& summary);

// The mean of any number of values, and quantiles of them: exact up to kMaxValues, which are 2.8 h
// of ten rounds a second; beyond, of a random sample of so many (the first of a fixed seed), whose
// rank is off by less than 0.2 % in 95 of 100 cases.
class Sample {
 public:
  static constexpr std::size_t kMaxValues = 100'000;

  void add(double value);
  // p50, p95, p99 and mean.
  Json json() const;
  std::size_t kept() const { return values_.size(); }

 private:
  std::vector<double> values_;
  double sum_ = 0;
  std::uint64_t count_ = 0;
  std::mt19937_64 random_{1};
};

// Counts the rounds of a run as they are over, in memory that does not grow with them: what
// summary.json says of a run of any length.
//
// The vehicle feeds it one row per round. The links and levels that rows name come from this host
// and from the roadside unit; of plans and levels kMaxKinds different ones each are told apart, and
// the rest are counted as "others" (level -1). Pure; thread-compatible; never throws.
class RunTally {
 public:
  // No measurement behind this value: a run has a handful of links and levels.
  static constexpr std::size_t kMaxKinds = 256;

  void add(const RoundRow& row);
  // What summarise() gives for all rows that were added.
  Json summary(const RunInfo& info) const;

 private:
  Sample on_time_ms_;
  Sample all_ms_;
  std::uint64_t rounds_ = 0;
  std::uint64_t answers_ = 0;
  std::uint64_t on_time_ = 0;
  std::uint64_t not_fresh_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t possible_ = 0;
  // Whether every answered round was compared with a clairvoyant.
  bool judged_ = true;
  std::map<int, std::uint64_t> levels_;
  std::map<std::string, std::uint64_t> used_;
  std::map<std::string, std::uint64_t> plans_;
};

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
