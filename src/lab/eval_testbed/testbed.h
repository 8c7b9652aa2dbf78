// The experiments of `interneuron eval --testbed`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/perception/accuracy.h"
#include "lab/eval/experiments/experiment.h"
#include "lab/eval/run.h"
#include "lab/eval_testbed/testbed_run.h"
#include "netns/testbed/testbed.h"

namespace interneuron::eval_testbed {

// Runs table-erdos with the programs `vehicle` and `road` on real sockets over emulated links, then
// the same seeds in virtual time with the run times that this machine had, and fills in the tables,
// series and notes of `document`. Takes as long as the rounds take. Throws Failure, and
// netns::TestbedError where namespaces are forbidden.
void run_table_erdos_on_testbed(const experiments::Request& request,
                                experiments::Document& document);

// What the deadline leaves to delays, as in virtual time: there, undisturbed rounds of erdos_like
// at the highest level of sim::default_ladder() end about 111 ms after t0, and the deadline is 130
// ms.
inline constexpr Duration kSlack = std::chrono::milliseconds(19);

// What one run left.
struct BenchRun {
  eval::Run run;
  // By round: from t0 until the image was submitted.
  std::vector<Duration> encode;
  // By round: the boxes that the application got.
  std::vector<perception::Shown> boxes;
};

// Runs systems with the programs `vehicle` and `road` in network namespaces, joined by emulated
// links, with real sockets, images and detection. Rounds take their time: 300 rounds at 10 Hz take
// half a minute. One testbed serves all runs of an experiment; it is taken down with the bench.
// Thread-compatible.
class Bench {
 public:
  // `ladder` is the --ladder of the programs. `scratch` is a folder for what the programs read and
  // write, private to this bench; it is made if it is not there. The scenario must outlive the
  // bench. Throws netns::TestbedError where namespaces are forbidden.
  Bench(const eval::Scenario& scenario, std::optional<std::filesystem::path> data,
        std::string ladder, std::filesystem::path scratch);

  // Runs rounds without injection, with the best image over the primary link, to learn the run
  // times of the roadside's ladder, the times that erdos_like freezes, what the hosts take, and the
  // deadline: kSlack after the end of an undisturbed round at the highest level, unless `deadline`
  // names another. Call it once, before run(). Throws Failure, also when no round was on time.
  void calibrate(std::uint32_t rounds, std::optional<Duration> deadline);
  // Runs as many rounds as the trace has, with its delays. Throws Failure.
  BenchRun run(const eval::System& system, const eval::Trace& trace, std::uint64_t seed);

  // The roadside's ladder as calibrated, with the profile's accuracies.
  const eval::Profile& profile() const { return profile_; }
  const eval::ErdosTimes& erdos() const { return erdos_; }
  Duration deadline() const { return deadline_; }
  // For the simulation to take as long as undisturbed rounds did here.
  const sim::HostTimes& hosts() const { return hosts_; }
  const std::string& ladder() const { return ladder_; }

 private:
  BenchRun start(const TestbedRun& orders, std::uint32_t rounds);
  void start_programs(const TestbedRun& orders, std::uint32_t rounds);
  std::vector<std::string> road_command() const;
  std::vector<std::string> vehicle_command(const TestbedRun& orders, std::uint32_t rounds) const;
  BenchRun collect(const TestbedRun& orders) const;
  sim::HostTimes host_times(const eval::System& system, const BenchRun& undisturbed) const;

  const eval::Scenario& scenario_;
  std::optional<std::filesystem::path> data_;
  // What the programs are given as --ladder.
  std::string kind_;
  std::filesystem::path scratch_;
  std::string video_;
  netns::Testbed testbed_;
  // The public halves, of keys that are made for this bench.
  std::string road_key_;
  std::string vehicle_key_;
  eval::Profile profile_;
  eval::ErdosTimes erdos_;
  Duration deadline_{};
  sim::HostTimes hosts_;
  std::string ladder_;
};

// The profile with the run times that the levels had in operation, less what was injected. A level
// that ran too rarely to tell keeps its calibrated times.
eval::Profile measured(const eval::Profile& calibrated,
                       const std::vector<std::vector<BenchRun>>& runs);

}  // namespace interneuron::eval_testbed
