// Rows of the tables that set systems side by side: ours, its ablations, the baselines and the
// bounds. rows.h says what all rows have in common.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lab/eval/metrics.h"

namespace interneuron::experiments {

// The first and the last seed of a row, both included.
struct Seeds {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
};

// End-to-end times over the rounds on time.
struct Times {
  std::optional<double> mean;
  std::optional<double> p50;
  std::optional<double> p95;
  std::optional<double> p99;
};

// Bytes of IP over all links in both directions, per round.
struct Traffic {
  double per_round = 0;
  double kb_per_round = 0;
  // By the name of the link.
  std::vector<std::pair<std::string, double>> links;
};

// What the oracle of the same table reaches.
struct OracleFigures {
  std::uint64_t timeouts = 0;
  double quality = 0;
  std::optional<double> effective_ap;
};

// One system, or one bound, over the rounds of all seeds.
struct SystemRow {
  std::string name;
  std::string about;
  // Neither guard nor policy: a bound.
  std::optional<std::string> guard;
  std::optional<std::string> policy;
  // Whether it is no form of ours.
  bool baseline = false;
  Seeds seeds;
  std::uint64_t rounds = 0;
  // Rounds without a remote result by the deadline.
  std::uint64_t timeouts = 0;
  eval::Interval timeouts_ci95{};
  double timeouts_share = 0;
  // Rounds missed right after a missed round.
  std::optional<std::uint64_t> consecutive;
  Times e2e_ms;
  // The mean of what the application really got, over all rounds and over those on time.
  double quality = 0;
  std::optional<double> quality_on_time;
  std::optional<Traffic> bytes;
  // COCO's AP and AR over rounds on time, and over every round with what was really shown.
  std::optional<double> ap;
  std::optional<double> ar;
  std::optional<double> effective_ap;
  std::optional<double> effective_ar;
  std::optional<OracleFigures> oracle;

  // In `table-lidar`, the mean agreement of what was shown with the clusters that the best level
  // finds on the whole sweep, over rounds on time and over every round.
  struct Agreement {
    std::optional<double> on_time;
    std::optional<double> effective;
  };
  std::optional<Agreement> agreement;

  // In `sweep`, what the deadline was, and by how much the injected delays were scaled.
  struct Sweep {
    int deadline_ms = 0;
    double severity = 0;
  };
  std::optional<Sweep> sweep;

  // In `timeout-handler`, `consecutive` against that of the guard without its handler, as a change
  // (-0.78: 78 % fewer). Unknown where that had none.
  struct Handler {
    std::optional<double> consecutive_change;
  };
  std::optional<Handler> handler;
};

// What the paper measured of one system.
struct PaperRow {
  std::string name;
  std::uint64_t rounds = 0;
  std::uint64_t timeouts = 0;
  double timeouts_share = 0;
  eval::Interval timeouts_ci95{};
  // It tells the mean time alone.
  struct MeanTime {
    int mean = 0;
  } e2e_ms;
  double ap = 0;
  double ar = 0;
};

// One system against ours on the same seeds.
struct LadderRow {
  std::string name;
  std::string about;
  bool baseline = false;
  std::uint64_t seeds = 0;
  eval::Paired more_timeouts_per_300;
  eval::Paired more_quality;
};

// One figure on the testbed and in the simulation.
struct Sides {
  std::optional<double> testbed;
  std::optional<double> sim;
};

// One system on the testbed against its simulation.
struct AgreementRow {
  std::string name;
  std::string image;
  struct OnTime {
    double testbed = 0;
    double sim = 0;
    // The difference of the shares.
    double points = 0;
  } on_time;
  struct Median {
    double testbed = 0;
    double sim = 0;
    // The testbed's as a change of the simulation's.
    double change = 0;
  } e2e_p50_ms;
  // Medians over undisturbed rounds.
  Sides uplink_ms;
  Sides compute_ms;
  Sides downlink_ms;
  // The largest difference in points that is still agreement.
  double points_aim = 0;
  bool on_time_agrees = false;
  bool e2e_agrees = false;
  // Nothing where a side has no undisturbed round with this image.
  std::optional<bool> uplink_agrees;
};

}  // namespace interneuron::experiments
