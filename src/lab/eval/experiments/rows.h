// The rows of an evaluation's tables, one type per kind of table. Experiments fill them in,
// findings judge by them, the report draws them; document.h puts them into tables, and
// document_json.cc alone knows how a file spells them. Times are milliseconds, shares lie within 0
// and 1, and an empty optional is what a row cannot know (null in the file). Plain values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "lab/eval/experiments/system_rows.h"

namespace interneuron::experiments {

enum class ClockFault : std::uint8_t { kOffset, kDrift, kStep };

// One system with a wrong clock at the roadside, round by round against the same run with the right
// one.
struct ClockRow {
  std::string name;
  ClockFault kind = ClockFault::kOffset;
  std::string system;
  std::string guard;
  Seeds seeds;
  std::uint64_t rounds = 0;
  // Rounds with another choice or outcome.
  std::uint64_t decided_differently = 0;
  // Rounds that differ in anything, times to the nanosecond included.
  std::uint64_t differ_at_all = 0;
  std::uint64_t timeouts = 0;
  std::uint64_t timeouts_at_offset_0 = 0;
  // The most rounds of one seed that only the wrong clock missed.
  std::uint64_t most_disturbed = 0;
};

struct Moments {
  double avg = 0;
  double min = 0;
  double max = 0;
  double std = 0;
};

// The round trips of one network.
struct NetworkRow {
  std::string name;
  Seeds seeds;
  std::uint64_t pings = 0;
  std::uint64_t lost = 0;
  std::optional<Moments> rtt_ms;
  // The standard deviation of the drives' means.
  std::optional<double> drive_mean_sd_ms;
  Moments paper_rtt_ms;
};

struct ApAr {
  std::optional<double> ap;
  std::optional<double> ar;
};

// One quality level of the detectors.
struct LevelRow {
  std::uint64_t level = 0;
  std::string name;
  ApAr raw;
  ApAr sampled;
  // The share of the AP that sampling costs.
  std::optional<double> lost_by_sampling;
  double median_ms = 0;
  double p95_ms = 0;
};

// Messages of one size over one network.
struct TransmissionRow {
  std::string network;
  std::uint64_t kilobytes = 0;
  Seeds seeds;
  std::uint64_t messages = 0;
  std::uint64_t undelivered = 0;
  struct Sent {
    double mean = 0;
    double p50 = 0;
    double p95 = 0;
  } ms;
};

// One round of the paper's scripted sequence.
struct ScriptRow {
  std::uint32_t round = 0;
  bool on_time = false;
  // The end-to-end time.
  double theta3_ms = 0;
  double x = 0;
  // What the roadside saw; empty for a frame that never came.
  struct Road {
    // The hand-over and the end of the computation, since t0.
    double theta1_ms = 0;
    std::optional<double> theta2_ms;
    // The deadline of stage 1, where the verdict tells it.
    std::optional<double> d1_ms;
    std::string image;
    std::uint64_t level = 0;
    bool d1_missed = false;
    bool at_d1 = false;
    bool d2_missed = false;
    std::string marks;
  };
  std::optional<Road> road;
};

// One level's run times on the machine of a testbed.
struct LevelTimesRow {
  std::string name;
  double calibrated_ms = 0;
  double calibrated_p95_ms = 0;
  double measured_ms = 0;
  double measured_p95_ms = 0;
};

using Rows = std::variant<std::vector<SystemRow>, std::vector<PaperRow>, std::vector<LadderRow>,
                          std::vector<ClockRow>, std::vector<NetworkRow>, std::vector<LevelRow>,
                          std::vector<TransmissionRow>, std::vector<ScriptRow>,
                          std::vector<AgreementRow>, std::vector<LevelTimesRow>>;

}  // namespace interneuron::experiments
