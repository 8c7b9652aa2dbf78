// From what the tools saw of a link and what its schedule prescribed to figures with verdicts.
// Pure; thread-compatible.
//
// A verdict is only ever made milder by a named cause: tcpdump dropped packets, or the emulator's
// own lateness, the frames that the kernel dropped before it, or chance account for what is beyond
// the bound. That makes the figure inconclusive, never ok.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "netns/verify/flow.h"
#include "netns/verify/readings.h"
#include "netns/verify/schedule.h"

namespace interneuron::cli::verify {

// The bounds within which a testbed is right.
inline constexpr double kMeanDelayPercent = 1;
inline constexpr double kDelayErrorP99Ms = 2;
inline constexpr double kLossPoints = 0.3;
inline constexpr double kRatePercent = 3;
inline constexpr double kBurstPercent = 10;
inline constexpr std::size_t kBurstsForVerdict = 1000;
// 99th percentiles and losses of fewer packets say too little: at 5 % the standard error of 10,000
// is 0.22 points already.
inline constexpr std::size_t kPacketsForVerdict = 10'000;
inline constexpr std::size_t kPingsForVerdict = 200;

enum class Verdict : std::uint8_t { kOk, kFailed, kNotMeasured, kInconclusive };
const char* verdict_name(Verdict verdict);  // "ok", "FAILED", "not measured", "inconclusive"

struct Figure {
  std::string name;  // "up loss"
  std::string unit;  // of target and measured: "ms", "%", "Mbit/s", "packets"
  std::optional<double> target;
  std::optional<double> measured;
  std::optional<double> difference;  // in difference_unit; may be absent where target is a limit
  std::string difference_unit;
  Verdict verdict = Verdict::kNotMeasured;
  std::string note;  // why not ok; one short line
};

Figure without_verdict(std::string name, std::string note, Verdict verdict);
// Unless it was not measured.
void inconclusive(Figure& figure, std::string note);

// What the profile asks of one direction beyond what a schedule holds.
struct Asked {
  bool reorder = false;
  bool duplicate = false;
  std::optional<emu::GilbertElliott> gilbert_elliott;
};

// What disturbed the testbed itself during a window.
struct Disturbance {
  double late_mean_ms = 0;  // of the emulator's frames
  double late_max_ms = 0;   // since the testbed is up
  std::uint64_t kernel_drops = 0;
};

// A saturated bottleneck; times since the epoch.
struct RateRun {
  Schedule schedule;
  std::vector<Datagram> received;
  std::uint64_t capture_drops = 0;
  std::uint64_t kernel_drops = 0;
  std::string not_measured;  // why it was not tried, if so
  std::string failure;       // why nothing came, if known
};

struct DirectionEvidence {
  Flow flow;                 // trimmed to the window
  std::string not_measured;  // as in RateRun
  std::string failure;
  Asked asked;
  emu::DirectionStats counted;  // by the testbed itself, during the window
  RateRun rate;
};

struct LinkEvidence {
  Schedule schedule;  // of the window and what was in flight
  Duration from{};    // the window
  Duration to{};
  PingLog pings;  // sent: since the epoch
  std::size_t ping_ip_bytes = 84;
  std::array<DirectionEvidence, 2> directions;  // indexed by Direction
  std::uint64_t capture_drops = 0;
  Disturbance disturbance;
};

std::vector<Figure> assess(const LinkEvidence& evidence);

// The figures' single judgements, for assess().
Figure judge_delay_mean(const std::string& name, const std::vector<double>& expected_ms,
                        const std::vector<double>& measured_ms);
Figure judge_delay_error(const std::string& name, const std::vector<double>& expected_ms,
                         const std::vector<double>& measured_ms);
Figure judge_loss(const std::string& name, double target_percent, double measured_percent);
Figure judge_rate(const std::string& name, const RateRun& run, Direction direction);

// All figures of all links: failed if one is, else inconclusive if one is, else ok.
Verdict overall(const std::vector<std::vector<Figure>>& links);

}  // namespace interneuron::cli::verify
